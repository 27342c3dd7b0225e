"""The proposed manoeuvre: its gain against slow, plain formulas, and what it proposes where the answer is known."""

from itertools import pairwise

import numpy as np
import pytest

from clutchid.errors import ParameterError, SolveError
from clutchid.estimation.assess.missing_excitation import RESET_SAMPLES, RESIDUAL_MEMORY, best_manoeuvre
from clutchid.inference.uncertainty.gaussian import WEIGHT_SIZES, Information
from clutchid.model import Actuator, Load
from clutchid.numerics.least_squares import triangular
from clutchid.simulation import Partition, simulate
from clutchid.truck import MANOEUVRES, Truck, drive

pytestmark = pytest.mark.slow

WEIGHT_UNIT = WEIGHT_SIZES["N/m"]
WEIGHTS = ("theta_1", "theta_2", "theta_3")


def sensitivities(actuator: Actuator, manoeuvre: str, seconds: float, names: tuple[str, ...]) -> np.ndarray:
    """Derivatives of the position along a manoeuvre, in units of 0.1 mm over natural sizes of load weights."""
    log = drive(Truck(), manoeuvre=manoeuvre, seconds=seconds).log
    simulation = simulate(actuator, log, partition=Partition(every=RESET_SAMPLES), sensitivities=names)
    return np.column_stack([simulation.sensitivities[name][:, 0] for name in names]) * WEIGHT_UNIT / 1e-4


def half_log_det(information: np.ndarray) -> float:
    return 0.5 * np.linalg.slogdet(information)[1]


@pytest.mark.parametrize("others", [(), ("P_S", "C_vs")], ids=["all", "with others that are not known"])
def test_the_gain_is_that_of_generalised_least_squares_with_the_covariance_written_out(truth, others):
    names = (*WEIGHTS, *others)
    R = triangular(np.random.default_rng(0).standard_normal((12, len(names))))
    proposal = best_manoeuvre(truth, WEIGHTS, Information(names, R), seconds=1.0)
    assert {gain.manoeuvre for gain in proposal.gains} == set(MANOEUVRES)
    lags = np.abs(np.subtract.outer(np.arange(RESET_SAMPLES), np.arange(RESET_SAMPLES)))
    inverse = np.linalg.inv(np.exp(-1e-3 * lags / RESIDUAL_MEMORY))
    before = np.linalg.inv(np.linalg.inv(R.T @ R)[:3, :3]) + np.eye(3)
    errors = np.sqrt(np.diag(np.linalg.inv(before)))
    for gain in proposal.gains[::3]:
        J = sensitivities(truth, gain.manoeuvre, 1.0, WEIGHTS)
        parts = [J[a:b] for a, b in pairwise(range(0, 1001, RESET_SAMPLES))]
        after = before + sum(part.T @ inverse @ part for part in parts)
        assert gain.nats == pytest.approx(half_log_det(after) - half_log_det(before), rel=1e-6)
        shrunk = np.sqrt(np.diag(np.linalg.inv(after))) / errors
        assert gain.shrinks_to == pytest.approx(shrunk[np.argmax(errors)], rel=1e-6)


def test_gains_are_sorted_and_the_best_is_proposed(truth):
    proposal = best_manoeuvre(truth, WEIGHTS, seconds=2.0)
    nats = [gain.nats for gain in proposal.gains]
    assert nats == sorted(nats, reverse=True)
    assert f"drive '{proposal.gains[0].manoeuvre}' for 2 s: the most informative of 8 manoeuvres" in proposal.message


def test_the_third_weight_asks_for_a_manoeuvre_that_reaches_far(truth):
    # within 1 s after the rest a slow ramp stays below 9 mm, where the hump of phi_3 has hardly begun
    proposal = best_manoeuvre(truth, ("theta_3",), Information(("theta_3",), 3 * np.eye(1)), seconds=1.0)
    left = {gain.manoeuvre: gain.shrinks_to for gain in proposal.gains}
    assert left[proposal.gains[0].manoeuvre] < 0.5 * left["ramps"]


def test_the_worst_standard_error_is_named_with_what_remains_of_it(truth):
    information = Information(WEIGHTS, np.diag([1e3, 1e3, 1.0]))
    proposal = best_manoeuvre(truth, WEIGHTS, information, seconds=3.0)
    assert "the standard error of theta_3 shrinks to" in proposal.message


def test_where_everything_is_known_no_manoeuvre_is_pressed_on_anyone(truth):
    proposal = best_manoeuvre(truth, WEIGHTS, Information(WEIGHTS, 1e6 * np.eye(3)), seconds=1.0)
    assert proposal.message.startswith("no manoeuvre of 1 s determines theta_")


def test_any_variant_and_basis_will_do():
    actuator = Actuator(model="energy-balance-stribeck", load=Load.on_b_splines())
    proposal = best_manoeuvre(actuator, (*actuator.load.names, "P_S", "C_ve"), seconds=3.0)
    assert [gain.nats > 0.0 for gain in proposal.gains] == [True] * len(MANOEUVRES)


def test_an_actuator_that_cannot_be_simulated_is_an_error(truth):
    with pytest.raises(SolveError, match=r"no manoeuvre can be simulated.*'ramps' is left out"):
        best_manoeuvre(truth.replace({"theta_1": -1e12}), WEIGHTS, seconds=1.0)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [({"names": ("theta_7",)}, "no parameter 'theta_7'"), ({"names": WEIGHTS, "seconds": 0.1}, "seconds = 0.1")],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(truth, arguments, sentence):
    with pytest.raises(ParameterError, match=sentence):
        best_manoeuvre(truth, **arguments)
