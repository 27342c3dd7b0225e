"""`fit` on recordings whose truth is known: what it finds, what it says, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from clutchid import FitRequest, fit
from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.estimation import simulation_error
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import Partition, simulate
from fixtures.changed_logs import spoiled

#: Weights of the load of `truth` in N/m.
TRUTH = (9.0e5, -0.3e5, 0.6e5)
AFAR = Actuator(load=Load((6e5, 1e5, 0.0)))


def weights(result) -> np.ndarray:
    return np.array([result.parameters[f"theta_{i}"].value for i in (1, 2, 3)])


@pytest.mark.parametrize(
    ("theta", "start"),
    [
        (TRUTH, None),
        (TRUTH, AFAR),
        # five multiples of the start are tried; 1.6 times a load that just about holds is beyond what can be simulated
        (TRUTH, Actuator(load=Load((9e5, -5e5, 0.0)))),
        (TRUTH, Actuator(load=Load((9e5, 0.0, -1e5)))),
        ((9e5, 0.4e5, 0.2e5), None),
    ],
    ids=["default start", "from afar", "trial points that blow up", "start beyond a bound", "second weight above 0"],
)
def test_the_load_is_found_again_without_noise(driven, theta, start):
    result = fit(driven(Actuator(load=Load(theta))), start)
    # the search stops at a relative cost change of 1e-9 above a noise floor of 0.1 um against strokes of 15 mm
    np.testing.assert_allclose(weights(result), theta, rtol=1e-5)
    assert result.status == "ok"
    assert result.warnings == ()
    assert result.errors.position_rms < 1e-7


@pytest.mark.parametrize(
    "partition",
    [Partition(every=100), Partition(every=100, carry="q"), Partition(parts=8), Partition(parts=8, carry="q")],
)
def test_the_load_is_found_again_in_partitioned_simulation(truth, drive, partition):
    # with q carried the steps are shorter than those that the recording was made with: errors of 0.1 um, 1e-5 of a
    # stroke, which the weak third weight (2 % of the load) takes 50 times enlarged
    rtol = 1e-6 if partition.carry == "p" else 5e-4
    np.testing.assert_allclose(
        weights(fit(drive, AFAR, request=FitRequest(partition=partition))), truth.load.theta, rtol=rtol
    )


def test_parameters_of_the_actuator_are_found_again_with_the_load(truth, driven):
    other = truth.replace({"P_S": 8.4e5, "C_vs": 2.2e-8, "F_C": 260.0})
    log = driven(other)
    names = ("load", "P_S", "C_vs", "F_C")
    result = fit(log, free=names, measure=("position", "pressure_a"))
    # the bounds of F_C ask for smaller steps than the recording was made with: errors of 0.1 um, 1e-5 of a stroke;
    # theta_3 is worth 60 N of 5 kN, so 1e-3 of it
    for name in ("theta_1", "theta_2", "P_S", "C_vs", "F_C"):
        assert result.parameters[name].value == pytest.approx(other.value(name), rel=1e-5), name
    assert result.parameters["theta_3"].value == pytest.approx(6e4, rel=1e-3)


def test_the_published_basis_is_kept_in_the_result(driven):
    published = Actuator(load=Load((9.385e5, -0.5817e5, 0.3909e5), phi2_slope=0.001))
    result = fit(driven(published), Actuator(load=Load(phi2_slope=0.001)))
    assert result.actuator.load.phi2_slope == 0.001
    np.testing.assert_allclose(weights(result), published.load.theta, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 1], ids=["noise on every sample", "none on the first"])
def test_with_white_noise_the_truth_lies_in_nineteen_of_twenty_intervals(truth, drive, with_noise, first):
    trials, hits, band = 40, np.zeros(3), 0.0
    for seed in range(trials):
        noisy = with_noise(drive.slice(0, 5000), seed)
        position = np.concatenate([drive["position"][:first], noisy["position"][first:]])
        result = fit(noisy.with_columns(position=position))
        estimates = [result.parameters[f"theta_{i}"] for i in (1, 2, 3)]
        hits += [e.low <= value <= e.high for e, value in zip(estimates, truth.load.theta, strict=True)]
        curve, force = result.load_curve, truth.load.force(result.load_curve.position)
        band += ((curve.low <= force) & (force <= curve.high))[4:65].mean() / trials  # 1 to 16 mm: it has been there
    assert np.all(hits >= binom.ppf(0.001, trials, 0.95)), hits / trials
    # the band is three numbers wide, so its coverage scatters like that of a third of the trials
    assert band >= binom.ppf(0.001, trials // 3, 0.95) / (trials // 3)


def test_the_noise_scale_is_that_of_the_noise(drive, with_noise):
    result = fit(with_noise(drive, 3, position=8e-5, pressure=3e3), measure=("position", "pressure_a"))
    # a standard deviation of 10^4 white samples: 0.7 %, five times that
    assert result.scales["position"] == pytest.approx(8e-5, rel=0.035)
    assert result.scales["pressure_a"] == pytest.approx(3e3, rel=0.035)
    assert result.errors.position_rms == pytest.approx(8e-5, rel=0.035)
    assert result.errors.pressure_a_rms == pytest.approx(3e3, rel=0.035)
    assert result.errors.position_sse == pytest.approx(10000 * result.errors.position_rms**2)
    assert result.errors.pressure_a_sse == pytest.approx(10000 * result.errors.pressure_a_rms**2)


def test_pressure_narrows_the_intervals(drive, with_noise):
    noisy = with_noise(drive, 4, position=5e-5, pressure=5e2)
    alone, both = fit(noisy), fit(noisy, measure=("position", "pressure_a"))
    assert both.parameters["theta_1"].std < 0.7 * alone.parameters["theta_1"].std


def test_pressure_alone_is_enough_for_the_load(truth, drive):
    np.testing.assert_allclose(weights(fit(drive, measure=("pressure_a",))), truth.load.theta, rtol=1e-5)


def test_several_recordings_share_the_load_and_have_names_of_their_own(truth, driven, with_noise):
    long, short, again = driven(), driven(reach=0.010), driven(name="drive (2)")
    result = fit([with_noise(long, 1), with_noise(short, 2), with_noise(again, 3)])
    assert list(result.recordings) == ["drive", "drive (3)", "drive (2)"]
    assert result.errors.position_sse == pytest.approx(sum(r.errors.position_sse for r in result.recordings.values()))
    for name, value in zip(("theta_1", "theta_2", "theta_3"), truth.load.theta, strict=True):
        estimate = result.parameters[name]
        assert abs(estimate.value - value) < 4 * estimate.std


def test_two_equal_recordings_halve_the_variance(drive, with_noise):
    noisy = with_noise(drive, 5)
    once, twice = fit(noisy), fit([noisy, noisy])
    np.testing.assert_allclose(weights(twice), weights(once), rtol=1e-6)
    # white residuals: the bandwidth may change by a lag or two, each worth a few percent
    np.testing.assert_allclose(twice.covariance, once.covariance / 2, rtol=0.3, atol=0.05 * once.covariance.max())


def test_a_missing_input_ends_a_segment_and_the_next_start_is_found(truth, drive):
    # the valves move while nobody looks, so the second segment starts at an unknown pressure
    holed = spoiled(drive, "duty_supply", slice(4300, 4500))
    result = fit(holed)
    assert result.status == "warning"
    assert "2 segments" in result.warnings[0]
    (_, first), (y, p_A) = result.recordings["drive"].starts
    assert first == 1.095e5
    # the free start is y and p_A, while v, p_B and z are taken as at rest: the staircase stands still there
    assert y == pytest.approx(drive["position"][4500], abs=0.2e-3)
    assert p_A == pytest.approx(drive["pressure_a"][4500], rel=0.02)
    np.testing.assert_allclose(weights(result)[0], truth.load.theta[0], rtol=0.01)


def test_a_start_under_pressure_at_rest_is_found_but_for_friction(truth, drive):
    # two seconds of closed valves; the recording begins before they open again
    shut = (drive.time > 1.0) & (drive.time < 3.0)
    duties = {name: np.where(shut, 0.0, drive[name]) for name in ("duty_supply", "duty_exhaust")}
    made = simulate(truth, drive.with_columns(**duties)).log.slice(2900, 10000)
    result = fit(replace(made.without("pressure_a"), name="later"))
    (y, p_A) = result.recordings["later"].starts[0]
    # the bristle holds up to F_C = 200 N there, 0.16 bar, but is taken as relaxed: the start lies a few of its lengths
    # of F_C / K_z = 0.2 mm away, with the same air in 26 mm of chamber
    assert y == pytest.approx(made["position"][0], abs=3 * 0.2e-3)
    assert p_A == pytest.approx(made["pressure_a"][0], abs=200 / 12.3e-3 + 5e5 * 0.6 / 26)
    assert weights(result)[0] == pytest.approx(truth.load.theta[0], rel=200 / 4900)


def test_a_start_made_by_the_rules_of_the_model_is_found_to_rounding(truth, drive):
    later = drive.slice(1100, 8000)
    made = simulate(truth, later, starts=[(9.1e-3, 4.9e5)]).log
    result = fit(replace(made.without("pressure_a"), name="later"))
    (y, p_A) = result.recordings["later"].starts[0]
    assert y == pytest.approx(9.1e-3, rel=1e-6)
    assert p_A == pytest.approx(4.9e5, rel=1e-6)
    np.testing.assert_allclose(weights(result), truth.load.theta, rtol=1e-5)


def test_verification_simulates_and_fits_nothing(truth, drive, driven):
    strange = driven(truth.replace({"theta_1": 8e5}), reach=0.012, name="strange")
    result = fit(drive, verify=[strange, drive])
    np.testing.assert_allclose(weights(result), truth.load.theta, rtol=1e-6)
    assert list(result.verification) == ["strange", "drive"]
    assert result.verification["strange"].errors.position_rms > 1e-4
    assert result.verification["drive"].errors.position_rms < 1e-7
    assert set(result.recordings) == {"drive"}


def test_nothing_free_is_a_simulation_with_errors(truth, drive):
    result = fit(drive, truth, free=())
    assert dict(result.parameters) == {}
    assert result.errors.position_rms < 1e-15 * 1e4
    assert result.actuator == truth


def test_a_bound_that_the_data_press_against_is_met_exactly_and_said(driven):
    worn = Actuator(load=Load((9e5, -0.3e5, -0.5e5)))
    result = fit(driven(worn))
    estimate = result.parameters["theta_3"]
    assert estimate.value == 0.0
    assert estimate.low == 0.0
    assert result.status == "warning"
    assert any("theta_3 lies at its lower bound 0 N/m" in warning for warning in result.warnings)
    free = fit(driven(worn), bounds={"theta_3": (-np.inf, np.inf)})
    np.testing.assert_allclose(weights(free), worn.load.theta, rtol=1e-6)


@pytest.mark.parametrize("status", ["stalled", "limit"])
def test_a_simulated_fit_that_can_gain_no_more_has_converged(driven, monkeypatch, status):
    minimise = simulation_error.minimise
    monkeypatch.setattr(
        simulation_error, "minimise", lambda *of, **options: replace(minimise(*of, **options), status=status)
    )
    result = fit(driven(Actuator(load=Load(TRUTH))))
    assert result.converged == (status == "stalled")
    assert result.message.startswith("converged after" if status == "stalled" else "stopped after")


def test_bounds_of_the_user_are_kept_exactly(drive):
    result = fit(drive, bounds={"theta_1": (9.2e5, 1e6), "theta_2": (-1e5, -0.5e5)})
    assert 9.2e5 <= result.parameters["theta_1"].value <= 1e6
    assert -1e5 <= result.parameters["theta_2"].value <= -0.5e5
    assert result.bounds["theta_1"] == pytest.approx((9.2e5, 1e6))
    assert any("bound" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"bounds": {"theta_1": (2.0, 1.0)}}, "theta_1: lower bound"),
        ({"bounds": {"theta_1": (1.0, 1.0)}}, "theta_1: lower bound"),
        ({"bounds": {"theta_1": (np.nan, 1.0)}}, "theta_1: lower bound"),
        ({"bounds": {"M": (5.0, 20.0)}}, "bounds for M, which is not free"),
        (
            {"free": ("C_vs",), "bounds": {"C_vs": (-1e-8, 4e-8)}},
            "C_vs: bound -1e-08 is not admissible, .* 0",
        ),
        ({"free": ("C_sv",)}, "did you mean 'C_vs'"),
        ({"measure": ("pressure",)}, "pressure_a"),
        ({"measure": ()}, "nothing to compare"),
    ],
)
def test_options_that_contradict_the_model_are_refused(drive, options, sentence):
    with pytest.raises(ParameterError, match=sentence):
        fit(drive, None, FitRequest(**options))


def test_verification_reports_problems_and_loses_nothing(drive):
    wrong = replace(drive.with_columns(position=drive["position"] - 2e-3), name="wrong zero")
    result = fit(drive, verify=[drive, wrong])
    assert result.status == "warning"
    assert any(w.startswith("verification: wrong zero") and "zero" in w for w in result.warnings)
    assert result.verification["drive"].errors.position_rms < 1e-7
    with pytest.raises(DataError, match="position"):
        fit(drive, verify=[drive.without("position", "pressure_a")])


@pytest.mark.parametrize(("scale", "zero"), [(1e3, 0.0), (-1.0, 0.0), (1.0, -8e-3), (1.0, 2e-2)])
def test_a_position_that_no_such_piston_can_have_is_refused_before_any_work(drive, scale, zero):
    strange = drive.with_columns(position=drive["position"] * scale + zero)
    with pytest.raises(DataError, match="check its unit, its sign and its zero"):
        fit(strange)


def test_three_parameters_of_which_only_a_product_is_known_are_named_together(drive, with_noise):
    result = fit(with_noise(drive, 8), free=("R", "T_0", "rho_0"))
    (warning,) = [w for w in result.warnings if "only combinations" in w]
    assert "T_0, R and rho_0" in warning or "R, T_0 and rho_0" in warning


def test_a_piston_that_moves_only_in_the_recording_is_a_warning(truth, drive):
    weak = truth.replace({"P_S": 1.12e5})  # bar typed as Pa, or the valves swapped: nothing can lift the piston
    result = fit(drive, weak, force=True)
    assert any("swapped" in w and "P_S" in w for w in result.warnings), result.warnings


def test_a_recording_without_what_is_measured_is_refused(drive):
    bare = replace(drive.without("pressure_a"), name="bare")
    with pytest.raises(DataError, match="bare: no column 'pressure_a'"):
        fit(bare, measure=("position", "pressure_a"))
    with pytest.raises(DataError, match="no finite sample"):
        fit(spoiled(drive, "pressure_a", slice(None)), measure=("pressure_a",))
    with pytest.raises(DataError, match="at least one"):
        fit([])


def test_three_samples_are_not_enough_and_the_message_says_what_is(drive):
    with pytest.raises(DataError, match=r"3 measured samples for 3 free parameters.*full stroke"):
        fit(drive.slice(0, 3), force=True)
    with pytest.raises(DataError, match="3 measured samples for 5 free parameters"):
        fit(drive.slice(1000, 1003), force=True)


def test_a_recording_below_the_second_knot_knows_the_first_weight_only(truth, driven):
    result = fit(driven(reach=0.0015))
    reach = result.recordings["drive"].measured["position"].max()
    assert reach < 2e-3
    assert result.parameters["theta_1"].value == pytest.approx(9e5, rel=1e-5)
    (warning,) = [w for w in result.warnings if "no information" in w]
    assert "theta_2 and theta_3" in warning
    assert f"it reaches y = {reach * 1e3:.1f} mm" in warning
    assert result.parameters["theta_2"].low == -np.inf
    assert result.parameters["theta_2"].high == np.inf
    assert result.parameters["theta_3"].high == np.inf
    curve = result.load_curve
    beyond = curve.position > 2e-3 + 1e-9
    assert np.isinf(curve.high[beyond]).all()
    assert np.isfinite(curve.high[~beyond]).all()


def test_a_recording_without_motion_does_not_determine_the_load(truth):
    n = 500
    generator = np.random.default_rng(12)
    still = {"position": 2e-5 * generator.standard_normal(n), "duty_supply": np.zeros(n), "duty_exhaust": np.zeros(n)}
    still["position"][0] = 0.0
    result = fit(Log(np.arange(n) * 1e-3, still, "still"), force=True)
    (warning,) = [w for w in result.warnings if "cannot determine" in w]
    assert "theta_1, theta_2 and theta_3" in warning
    assert all(np.isinf(estimate.high) for estimate in result.parameters.values())
    assert np.isinf(result.load_curve.high[1:]).all()


def test_a_short_stroke_cannot_separate_the_second_and_the_third_weight_and_warns(driven, with_noise):
    result = fit(with_noise(driven(reach=0.0065), 6))
    reach = result.recordings["drive"].measured["position"].max()
    assert 4e-3 < reach < 8.6e-3
    (warning,) = [w for w in result.warnings if "cannot be estimated separately" in w and "theta_2 and theta_3" in w]
    assert f"reaches {reach * 1e3:.1f} mm; record strokes to 11.5 mm or more" in warning
    # the sum is known where the recording has been, whatever the parts are
    curve = result.load_curve
    been = (curve.position > 1e-3) & (curve.position < 5e-3)
    assert np.all((curve.high - curve.low)[been] < 0.05 * curve.force[been])


def test_a_full_stroke_separates_the_weights(drive, with_noise):
    assert fit(with_noise(drive, 7)).warnings == ()


def test_parameters_that_only_act_together_are_reported(drive, with_noise):
    result = fit(with_noise(drive, 8), free=("load", "rho_0", "C_vs", "C_ve", "C_r"))
    assert any("cannot be estimated separately" in w and "rho_0" in w for w in result.warnings)


def test_start_values_that_cannot_be_simulated_raise_or_return_as_asked(drive):
    pulled = Actuator(load=Load((0.0, -1e12, 0.0)))
    with pytest.raises(SolveError, match=r"start values cannot be simulated.*diverged at \d\.\d{3} s in .*y"):
        fit(drive, pulled)
    result = fit(drive, pulled, on_failure="return")
    assert result.status == "failed"
    assert "diverged at" in result.message
    assert np.isnan(result.parameters["theta_1"].value)
    assert np.isnan(result.load_curve.force).all()
    assert result.recordings == {}


def test_the_load_curve_has_101_points_over_the_stroke_and_the_fitted_force(drive):
    result = fit(drive)
    curve = result.load_curve
    np.testing.assert_allclose(curve.position, np.linspace(0, 25e-3, 101))
    assert np.array_equal(curve.force, result.actuator.load.force(curve.position))
    assert np.all((curve.low <= curve.force) & (curve.force <= curve.high))


def test_estimates_carry_units_and_intervals_around_the_value(drive, with_noise):
    result = fit(with_noise(drive, 9), free=("load", "P_S"))
    assert {name: e.unit for name, e in result.parameters.items()} == {
        "theta_1": "N/m", "theta_2": "N/m", "theta_3": "N/m", "P_S": "Pa",
    }  # fmt: skip
    for i, estimate in enumerate(result.parameters.values()):
        assert estimate.low < estimate.value < estimate.high
        assert estimate.std == pytest.approx(np.sqrt(result.covariance[i, i]))
        # 95 % of Student's t with many degrees of freedom
        assert (estimate.high - estimate.value) / estimate.std == pytest.approx(1.96, abs=0.05)


def test_fixed_parameters_stay(drive):
    actuator = Actuator(Parameters(M=12.0))
    assert fit(drive, actuator).actuator.parameters == actuator.parameters
