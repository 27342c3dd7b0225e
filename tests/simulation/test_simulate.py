"""What `simulate` promises: starts, segments, resets, failures as values, and steps that follow the model."""

import numpy as np
import pytest

from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import Partition, simulate
from clutchid.simulation.plan import plan
from clutchid.simulation.run import KernelArrays, columns, run, run_with_sensitivities
from clutchid.simulation.stiffness import MOST_SUBSTEPS, STABLE_STEP, stiffness, stiffness_over, substeps
from fixtures.changed_logs import picked, spoiled

STATES = ("position", "velocity", "pressure_a", "pressure_b", "deflection")


def opened(n: int = 100, **columns) -> Log:
    duties = {"duty_supply": np.ones(n), "duty_exhaust": np.zeros(n)}
    return Log(np.arange(n) * 1e-3, {**duties, **columns}, "run")


def test_a_simulation_is_a_log_with_the_columns_of_the_contract(truth, drive):
    result = simulate(truth, drive)
    assert (result.status, result.message, result.warnings) == ("ok", "simulated to the end", ())
    assert set(result.log.columns) == {*STATES, "duty_supply", "duty_exhaust"}
    assert np.array_equal(result.log.time, drive.time)
    assert np.array_equal(result.log["duty_supply"], drive["duty_supply"])
    assert result.log.name == "drive"
    assert all(np.isfinite(result.log[name]).all() for name in STATES)


def test_stepping_sample_by_sample_is_the_same_as_one_run(truth, drive):
    # 10^4 steps of the same machine instructions; only what the compiler hoists may round differently
    assert np.abs(simulate(truth, drive).log["position"] - drive["position"]).max() < 1e4 * 2.3e-16 * 15e-3


def test_sensitivities_come_by_name_for_all_five_states_and_do_not_change_the_states(truth, drive):
    plain, rich = simulate(truth, drive), simulate(truth, drive, sensitivities=("C_vs", "theta_3"))
    assert set(rich.sensitivities) == {"C_vs", "theta_3"}
    assert rich.sensitivities["C_vs"].shape == (len(drive), 5)
    assert np.abs(plain.log["position"] - rich.log["position"]).max() < 1e4 * 2.3e-16 * 15e-3


def test_an_unknown_sensitivity_is_refused_with_the_nearest_name(truth, drive):
    with pytest.raises(ParameterError, match="did you mean 'theta_1'"):
        simulate(truth, drive, sensitivities=("tetha_1",))


@pytest.mark.parametrize(
    ("missing", "options"),
    [("duty_supply", {}), ("duty_exhaust", {}), ("position", {"partition": Partition(every=10)})],
)
def test_a_recording_without_a_column_that_is_needed_is_refused_by_name(truth, drive, missing, options):
    with pytest.raises(DataError, match=missing):
        simulate(truth, drive.without(missing), **options)


def test_a_hole_in_time_ends_a_segment(truth, drive):
    result = simulate(truth, picked(drive, np.r_[0:4200, 4260:10000]))
    assert np.isfinite(result.log["position"]).all()
    assert result.log["position"][4200] == drive["position"][4260]
    assert "2 segments" in result.warnings[0]
    assert "4.260 s" in result.warnings[0]


def test_a_single_lost_sample_is_no_hole(truth, drive):
    gap = picked(drive, np.r_[0:4200, 4201:10000])
    result = simulate(truth, gap)
    assert result.warnings == ()
    # the input is held over the lost sample; it changes slowly there
    assert np.abs(result.log["position"] - gap["position"]).max() < 20e-6


def test_a_single_known_sample_between_holes_belongs_to_no_segment(truth, drive):
    result = simulate(truth, spoiled(drive, "duty_supply", [4200, 4202]))
    assert np.isnan(result.log["position"][4200:4203]).all()
    assert "2 segments" in result.warnings[0]


@pytest.mark.parametrize("names", [(), ("theta_1",), ("C_vs",)])
def test_a_simulation_that_blows_up_names_time_and_state(names):
    # a load that pulls beyond t_2 with a force that grows as fast as the piston runs away
    pulled = Actuator(load=Load((9e5, -1e12, 0.0)))
    with pytest.raises(SolveError, match=r"run: .*diverged at 0\.\d{3} s in .*y"):
        simulate(pulled, opened(), sensitivities=names)
    result = simulate(pulled, opened(), sensitivities=names, on_failure="return")
    assert result.status == "failed"
    assert "diverged at" in result.message
    failed = int(np.argmax(~np.isfinite(result.log["position"])))
    assert f"{failed * 1e-3:.3f} s" in result.message
    assert np.isfinite(result.log["position"][:failed]).all()
    assert np.isnan(result.log["position"][failed + 1 :]).all()


def test_a_failed_segment_does_not_stop_the_next_one():
    # the measured position puts the second segment below t_2, where the load does not pull
    log = spoiled(opened(300, position=np.where(np.arange(300) < 150, 0.0, 1e-3)), "duty_supply", slice(150, 160))
    log = spoiled(log, "duty_supply", slice(160, 300), 0.0)
    result = simulate(Actuator(load=Load((9e5, -1e12, 0.0))), log, on_failure="return")
    assert result.status == "failed"
    assert np.isfinite(result.log["position"][160:]).all()


def test_a_reset_takes_the_measurement_and_lets_the_other_states_go_on(truth, driven):
    log = driven(seconds=2.0)
    shifted = log.with_columns(position=log["position"] + np.where(log.time > 0.6, 1e-3, 0.0))
    result = simulate(truth, shifted, partition=Partition(every=500)).log
    ballistic = simulate(truth, log).log
    # the reset at 1 s shows one sample later; velocity is zero there, pressure does not jump
    # up to there: the reset at 0.5 s takes what was simulated from the same start, but for the rounding of its median
    np.testing.assert_allclose(result["position"][:1001], ballistic["position"][:1001], rtol=0, atol=1e-12)
    assert result["position"][1001] == pytest.approx(shifted["position"][1000], abs=0.05e-3)
    assert result["pressure_a"][1001] == pytest.approx(ballistic["pressure_a"][1000], rel=0.01)


def test_a_reset_at_a_missing_measurement_waits_for_the_next_one(truth, driven):
    log = driven(seconds=2.0)
    shifted = log.with_columns(position=log["position"] + np.where(log.time > 0.6, 1e-3, 0.0))
    waiting = simulate(truth, spoiled(shifted, "position", slice(1000, 1007)), partition=Partition(parts=2)).log
    prompt = simulate(truth, shifted, partition=Partition(parts=2)).log
    assert prompt["position"][1001] - prompt["position"][1000] > 0.9e-3
    assert np.abs(np.diff(waiting["position"][1000:1008])).max() < 0.05e-3
    assert waiting["position"][1008] - waiting["position"][1007] > 0.9e-3


def test_resets_after_the_last_measurement_do_not_happen(truth, driven):
    log = spoiled(driven(seconds=2.0), "position", slice(1500, None))
    result = simulate(truth, log, partition=Partition(every=400)).log
    assert np.isfinite(result["position"]).all()


def air_across_a_reset(carry: str, **measured: float) -> tuple[np.ndarray, np.ndarray]:
    """Air in A and B in Pa m³, valves closed and B sealed, where a measurement follows 6 mm and 4 bar in the middle."""
    n, step = 200, 1e-3 / 16
    sealed = Actuator(Parameters(C_r=0.0), Load((9e5, 0.0, 0.0)))
    columns = {"duty_supply": 0.0, "duty_exhaust": 0.0, **measured}
    log = Log(np.arange(n) * step, {name: np.full(n, value) for name, value in columns.items()}, "shut")
    reset, pressure = Partition(every=100, carry=carry), "pressure_a" in measured
    segment = plan(log, sealed, stiffness(sealed), reset, use_pressure=pressure).segments[0]
    states, failed = run(segment, KernelArrays.of(sealed), np.array([6e-3, 0.0, 4.0e5, 1.095e5, 0.0]))
    assert failed == -1
    y, p_A, p_B = states[:, 0], states[:, 2], states[:, 3]
    return p_A * (0.148e-3 + 12.3e-3 * y), p_B * (1.2e-4 + 11.848e-3 * (25e-3 - y))


#: Truncation as in the laws, (h lambda)^4, of what moves.
KEPT = 4e-4


@pytest.mark.parametrize("carry", ["p", "q"])
def test_carrying_q_keeps_the_masses_of_air_across_a_reset_and_carrying_p_does_not(carry):
    a, b = (abs(mass[-1] / mass[0] - 1) for mass in air_across_a_reset(carry, position=7e-3))
    # made air: 1 mm of 18 mm, and of 29 mm
    assert (a < KEPT, a > 0.03) == (carry == "q", carry == "p")
    assert (b < KEPT, b > 0.02) == (carry == "q", carry == "p")


@pytest.mark.parametrize("carry", ["p", "q"])
def test_a_reset_with_pressure_takes_it_and_carries_chamber_b_alone(carry):
    a, b = air_across_a_reset(carry, position=7e-3, pressure_a=5.0e5)
    assert a[-1] == pytest.approx(5.0e5 * (0.148e-3 + 12.3e-3 * 7e-3), rel=KEPT)
    lost = abs(b[-1] / b[0] - 1)
    assert (lost < KEPT, lost > 0.02) == (carry == "q", carry == "p")


def test_a_slow_log_takes_smaller_steps_inside_its_intervals(truth):
    # valves that change every 10 ms: the same inputs at 1 kHz and at 100 Hz
    generator = np.random.default_rng(11)
    supply = np.repeat(np.where(generator.random(60) < 0.25, generator.uniform(0.2, 0.8, 60), 0.0), 10)
    exhaust = np.repeat(np.where(generator.random(60) < 0.2, generator.uniform(0.2, 0.6, 60), 0.0), 10)
    t = np.arange(600) * 1e-3
    fast = simulate(truth, Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})).log
    slow = simulate(truth, Log(t[::10], {"duty_supply": supply[::10], "duty_exhaust": exhaust[::10]})).log
    assert fast["position"].max() > 8e-3
    # both within a micrometre of the truth
    assert np.abs(slow["position"] - fast["position"][::10]).max() < 2e-6


def test_the_stiffest_part_of_the_paper_is_chamber_b_at_full_stroke():
    # straight line from psi(r_lam) to 0: C_r rho_0 R T_0 psi(r_lam) / (1 - r_lam) / V_0B
    psi = 0.5 * np.sqrt(1 - 0.999**2) + 0.5 * np.sqrt(1 - ((0.999 - 0.582) / 0.418) ** 2)
    expected = 5e-8 * 1.185 * 288 * 293 * psi / 1e-3 / 1.2e-4
    # the grid looks 0.2 mm into the stop (2 % less volume) and at top speed (0.3 m/s * A_B / V_B = 30 1/s more)
    assert stiffness(Actuator()) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("order", [("C_r", "V_0B"), ("V_0B", "C_r")])
def test_stiffness_over_bounds_is_that_of_the_stiffest_corner_of_several_parameters(
    order,
):
    # the seals are the fastest; a wider breather matters only where chamber B is small
    actuator = Actuator(Parameters(F_C=100.0))
    bounds = {"C_r": (5e-8, 6e-8), "V_0B": (0.7e-4, 1.2e-4), "theta_1": (0, np.inf)}
    assert stiffness(actuator.replace({"C_r": 6e-8})) <= stiffness(actuator)
    expected = stiffness(actuator.replace({"C_r": 6e-8, "V_0B": 0.7e-4}))
    assert expected > 1.1 * stiffness(actuator.replace({"V_0B": 0.7e-4}))
    assert stiffness_over(actuator, {name: bounds[name] for name in ("theta_1", *order)}) == expected


@pytest.mark.parametrize("rate", [1.0, 2300.0, 2436.1465, 1e5 / 3])
def test_an_interval_of_a_whole_number_of_longest_steps_takes_so_many(rate):
    whole = np.arange(1, 200)
    assert np.array_equal(substeps(whole * (STABLE_STEP / rate), rate), whole)
    # more than the rounding is another step
    assert np.array_equal(substeps(whole * (STABLE_STEP / rate) * (1 + 1e-8), rate), whole + 1)


@pytest.mark.parametrize("valve", ["C_vs", "C_ve"])
def test_either_valve_can_be_what_makes_the_model_stiff(valve):
    small = Actuator(Parameters(V_0A=1e-5))
    ten, twenty = (stiffness(small.replace({valve: k * small.value(valve)})) for k in (10, 20))
    # a chamber fills or empties at a rate that goes with its valve; all else is slower than a tenth of that
    assert twenty / ten == pytest.approx(2, rel=0.1)


def test_a_model_too_stiff_for_the_recording_is_refused_in_words(drive):
    with pytest.raises(ParameterError, match=f"too stiff.* at most {MOST_SUBSTEPS}"):
        simulate(Actuator(Parameters(M=1e-5)), drive)


def test_a_plan_starts_and_resets_at_the_measured_pressure_where_it_is_used(truth, drive):
    later = drive.slice(1000, 3000)
    used = plan(later, truth, 2000.0, Partition(every=100), use_pressure=True).segments[0]
    assert used.pressure_start == later["pressure_a"][0]
    assert np.array_equal(np.flatnonzero(used.jump), np.arange(100, 2000, 100))
    assert np.array_equal(used.measured[100], [later["position"][100], later["pressure_a"][100]])
    assert set(used.jump[used.jump > 0]) == {3}
    unused = plan(later, truth, 2000.0, Partition(every=100, carry="q")).segments[0]
    assert np.isnan(unused.pressure_start)
    assert set(unused.jump[unused.jump > 0]) == {2}


def test_where_the_pressure_is_missing_at_a_reset_only_the_position_is_taken(truth, drive):
    later = spoiled(drive.slice(1000, 3000), "pressure_a", slice(200, 201))
    segment = plan(later, truth, 2000.0, Partition(every=100), use_pressure=True).segments[0]
    assert segment.jump[[100, 200, 300]].tolist() == [3, 1, 3]


@pytest.mark.parametrize(
    ("position", "vented"),
    [(0.0, True), (0.4e-3, True), (0.7e-3, False), (12e-3, False)],
)
def test_a_recording_starts_vented_where_it_is_still_and_near_zero(truth, position, vented):
    log = Log(np.arange(100) * 1e-3, {k: np.zeros(100) for k in ("duty_supply", "duty_exhaust")})
    noise = 2e-5 * np.sin(np.arange(100))
    assert plan(log.with_columns(position=position + noise), truth, 2000.0).segments[0].vented == vented


def test_a_recording_that_starts_moving_is_not_vented(truth):
    t = np.arange(100) * 1e-3
    log = Log(t, {"duty_supply": np.zeros(100), "duty_exhaust": np.zeros(100), "position": 0.4e-3 - 0.05 * t})
    assert not plan(log, truth, 2000.0).segments[0].vented


def test_each_segment_has_the_start_that_is_given_for_it(truth, drive):
    log = spoiled(drive.slice(1000, 2000), "duty_supply", slice(500, 510))
    result = simulate(truth, log, starts=[(14e-3, 4.7e5), (12e-3, 4.1e5)]).log
    assert [(result["position"][k], result["pressure_a"][k]) for k in (0, 510)] == [(14e-3, 4.7e5), (12e-3, 4.1e5)]
    with pytest.raises(ParameterError, match="1 given, the recording has 2"):
        simulate(truth, log, starts=[(0, 1e5)])


def test_of_several_failures_the_first_is_reported():
    pulled = Actuator(load=Load((9e5, -1e12, 0.0)))
    log = spoiled(opened(400), "duty_supply", slice(200, 201))
    result = simulate(pulled, log, starts=[(0.0, 1.1e5), (5e-3, 3e5)], on_failure="return")
    failed = [int(np.argmax(~np.isfinite(result.log["position"][part]))) for part in (slice(0, 200), slice(201, 400))]
    assert 0 < failed[1] < failed[0]
    assert f"at {failed[0] * 1e-3:.3f} s in" in result.message


@pytest.mark.parametrize(("planned", "driven_by"), [("isothermal", "energy-balance"), ("energy-balance", "isothermal")])
def test_a_segment_planned_for_another_model_is_refused(drive, planned, driven_by):
    segment = plan(drive.slice(0, 100), Actuator(model=planned), 2000.0).segments[0]
    actuator, n_states = Actuator(model=driven_by), {"isothermal": 5, "energy-balance": 8}[driven_by]
    numbers, x0 = KernelArrays.of(actuator), np.zeros(n_states)
    wanted = f"with {segment.inputs.shape[1]} inputs cannot be run by the model {driven_by}, .* plan the recording"
    with pytest.raises(ParameterError, match=wanted):
        run(segment, numbers, x0)
    which = columns(actuator, ("C_vs",))
    with pytest.raises(ParameterError, match=wanted):
        run_with_sensitivities(segment, numbers, (x0, np.zeros((n_states, 1))), which, (0,))
