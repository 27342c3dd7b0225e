"""`shoot`: from recordings to the end of the search, with the phases of the carrier and the noise re-estimated."""

from types import SimpleNamespace

import numpy as np
import pytest

from clutchid.estimation import shooting as module
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.shooting import MODEL_MEMORY, SHOOTING, shoot
from clutchid.inference.smoother.search import USUAL_EFFORT
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import changeable
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.preparation.prepare import prepare
from clutchid.preparation.pulses import pulsed
from clutchid.simulation.stiffness import stiffness

EXACT = Calibration((), np.zeros((0, 0)))


@pytest.fixture(scope="module")
def switched(plant):
    return plant.replace({"T_pwm": 0.01, "s_pwm": 0.3, "s_vs": 0.07, "s_ve": 0.07, "tau_p": 0.0})


@pytest.fixture(scope="module")
def carried(switched, recorded_by):
    """Two recordings of the switched plant, begun at different phases."""
    later = switched.replace({"s_pwm": -0.2})
    return [recorded_by(switched, 4.0, name="one"), recorded_by(later, 4.0, seed=8, name="two")]


def test_noise_scales_are_those_of_the_recording(plant, recorded_by):
    log = recorded_by(plant, 4.0, seed=None)
    rng = np.random.default_rng(1)
    rough = log.with_columns(position=log["position"] + 1.5e-4 * rng.standard_normal(len(log)))
    shot = shoot([rough], plant, FreeParameters(plant.load.names, ("position",)), EXACT)
    assert isinstance(shot.solution, Solution)
    # 4000 samples tell a median to 2 %; the windows follow some of the noise
    assert shot.problem.noise.measured["position"] == pytest.approx(1.5e-4, rel=0.1)
    assert set(shot.problem.noise.measured) == {"position"}


def test_the_reference_of_the_shape_is_the_calibrated_load_or_none(plant, drive_log):
    log = drive_log.slice(0, 1000).without("pressure_a")
    wanted = FreeParameters(("theta_5",), ("position",))
    assert shoot([log], plant, wanted, EXACT).problem.reference == plant.load.theta
    assert shoot([log], plant, wanted).problem.reference == (0.0,) * 22


def test_a_start_that_cannot_be_simulated_is_a_failure_with_a_sentence(plant, drive_log, monkeypatch):
    failure = Failure("y is not finite at 0.1 s.")
    monkeypatch.setattr(module, "initial_states", lambda *_: failure)
    shot = shoot([drive_log.slice(0, 2000)], plant, FreeParameters(("theta_5",), ("position",)))
    assert shot.solution is failure
    assert len(shot.problem.plans) == 1


def test_a_recording_without_a_single_position_leaves_what_was_known(plant, drive_log):
    nothing = drive_log.slice(0, 2000).with_columns(position=np.full(2000, np.nan))
    shot = shoot([nothing.without("pressure_a")], plant, FreeParameters(("C_vs",), ("position",)))
    assert shot.solution.x == pytest.approx([0.0], abs=1e-6)


def test_a_search_ends_in_the_problem_linearised_there_so_that_it_can_be_evaluated_again(plant, drive_log):
    free = FreeParameters(("theta_5", "C_vs"), ("position",))
    shot = shoot([drive_log.slice(0, 1500).without("pressure_a")], plant, free, EXACT)
    again = SHOOTING.evaluated(shot.problem, shot.solution.x, shot.solution.at.X)
    assert again.cost == shot.solution.at.cost
    for chain, expected in zip(again.chains, shot.solution.at.chains, strict=True):
        assert np.array_equal(chain.windows.linearised.jacobian, expected.windows.linearised.jacobian)
        assert np.array_equal(chain.windows.linearised.r, expected.windows.linearised.r)


def test_a_narrow_prior_far_from_the_start_value_is_reached(plant, drive_log):
    anchor = FreeParameters(("P_S",), ("position",), priors={"P_S": Prior(8.5e5, 10.0)})
    shot = shoot([drive_log.slice(0, 1500).without("pressure_a")], plant, anchor, EXACT)
    assert shot.problem.si(shot.solution.x)[0] == pytest.approx(8.5e5, abs=100.0), (
        "5000 deviations from where it started"
    )


@pytest.mark.parametrize("calibration", [EXACT, None], ids=["calibrated", "plain"])
@pytest.mark.parametrize("measure", [("position",), ("position", "pressure_a")], ids=["position", "both"])
def test_residuals_have_a_memory_in_every_fit(plant, drive_log, measure, calibration):
    shot = shoot([drive_log.slice(0, 1000)], plant, FreeParameters(("theta_5",), measure), calibration)
    assert shot.problem.noise.memory == MODEL_MEMORY


def test_the_plan_follows_a_stiffness_above_that_of_the_start(plant, drive_log):
    plan = prepare(drive_log, plant, ("position",))
    steps = plan.segments[0].substeps.max()
    assert steps >= 1.3 * stiffness(plant) * 1e-3 / 2.5
    assert np.flatnonzero(plan.segments[0].jump)[:3].tolist() == [20, 40, 60], "the first guess starts anew every 20 ms"


def test_without_a_carrier_the_actuator_stays(plant, drive_log):
    assert pulsed(drive_log, plant, True).actuator is plant


@pytest.mark.slow
def test_each_recording_has_the_phase_of_its_own_carrier(switched, carried):
    logs = [log.without("pressure_a") for log in carried]
    shot = shoot(logs, switched, FreeParameters(("theta_9", "theta_10"), ("position",)), EXACT)
    added = ("s_pwm", "y_max", *changeable(switched))
    own = {f"{name}@{stem}" for name in added for stem in ("one", "two")}
    assert set(shot.problem.names) == {"theta_9", "theta_10", *own}
    phases = [shot.problem.actuator_of(shot.solution.x, stem).value("s_pwm") for stem in ("one", "two")]
    # seconds of a position with 30 µm of noise tell the phase to a hundredth of the period
    assert phases == pytest.approx([0.3, -0.2], abs=0.02)


def test_where_the_valves_phases_are_free_the_first_recording_keeps_its_own(switched, carried):
    shot = shoot(carried, switched, FreeParameters(("s_vs", "s_ve"), ("position", "pressure_a")), EXACT)
    assert shot.problem.names == ("s_vs", "s_ve", "s_pwm@two")
    opened = [shot.problem.actuator_of(shot.solution.x, stem) for stem in ("one", "two")]
    phases = [actuator.value("s_pwm") + actuator.value("s_vs") for actuator in opened]
    assert phases == pytest.approx([0.37, -0.13], abs=0.02)


@pytest.mark.slow
def test_a_prior_of_the_user_on_a_phase_wins(switched, carried):
    own = {"s_pwm@one": Prior(0.25, 1e-6)}
    shot = shoot([carried[0]], switched, FreeParameters(("theta_9",), ("position",), priors=own), EXACT)
    assert shot.problem.actuator_of(shot.solution.x, "one").value("s_pwm") == pytest.approx(0.25, abs=1e-5)


@pytest.mark.parametrize(
    ("costs", "cost", "status"),
    [
        ((1000.0, 1001.0), 1000.0, "converged"),
        ((1000.0, 900.0, 899.0), 899.0, "converged"),
        ((1000.0, 1010.0), 1000.0, "stalled"),
        ((1000.0, 900.0, 800.0, 700.0, 600.0), 600.0, "stalled"),
    ],
)
def test_a_search_that_stalls_at_the_same_cost_from_new_states_has_converged(monkeypatch, costs, cost, status):
    left = iter(costs)
    monkeypatch.setattr(module, "_states", lambda *_: ())
    monkeypatch.setattr(
        module, "search", lambda *_: Solution(np.zeros(1), SimpleNamespace(cost=next(left), X=()), "stalled", 7)
    )
    solution = module._fine(SimpleNamespace(stems=()), np.zeros(1), (), USUAL_EFFORT, None)
    assert (solution.at.cost, solution.status) == (cost, status)
    assert tuple(start.cost for start in solution.starts) == costs
    assert [start.name for start in solution.starts[:2]] == ["initial values", "new states 1"]
    assert next(left, None) is None
