"""The sensitivities that a simulation carries against central finite differences of the simulation itself."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator, Load, own_model
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation import Partition, simulate

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "maxwell_slip.py"

#: Relative steps, first those at which most parameters agree.
STEPS = (1e-5, 1e-6, 1e-4, 1e-7, 1e-8, 1e-9)


def stack(log: Log, actuator: Actuator) -> np.ndarray:
    return np.column_stack([log[row.column] for row in actuator.state_rows.values()])


def mistaken(
    actuator: Actuator, log: Log, starts=None, partition: Partition | None = None, names: Iterable[str] = ()
) -> dict[str, float]:
    """For every name, or some, the error of a sensitivity in units of what is allowed, at the first step where it is.

    Both carry the same integration steps, so the derivative of the numbers themselves is exact. Allowed is what a
    central difference cannot do better: the rounding of 3000 steps (2e-13 of the largest state) over the step, and
    1e-5 of the largest sensitivity for stages that lie on the other side of a kink (knot, |v|, r_lam, stop) in one of
    the two runs. A number that is 0 switches something off and has no relative step; those are left out.
    """
    names = [name for name in names or actuator.names if actuator.value(name) != 0]
    whole = simulate(actuator, log, partition=partition, starts=starts, sensitivities=names)
    rounding = 2e-13 * np.abs(stack(whole.log, actuator)).max(axis=0)
    worst = {}
    for name in names:
        value, exact = actuator.value(name), whole.sensitivities[name]
        worst[name] = np.inf
        for step in STEPS:
            if worst[name] <= 1:
                break
            h = step * abs(value)
            up, down = (
                stack(
                    simulate(actuator.replace({name: value + d}), log, partition=partition, starts=starts).log, actuator
                )
                for d in (h, -h)
            )
            allowed = 1e-5 * np.abs(exact).max(axis=0) + rounding / h
            error = float((np.abs((up - down) / (2 * h) - exact).max(axis=0) / allowed).max())
            worst[name] = min(worst[name], error)
    return worst


@pytest.fixture(scope="module")
def rough(driven) -> Log:
    """3 s that reach the end stop, and a position that differs from the simulated one by a slow millimetre."""
    log = driven(seconds=3.0)
    t = log.time
    supply = np.where((t > 1.0) & (t < 1.3), 1.0, log["duty_supply"])
    exhaust = np.where((t > 1.0) & (t < 1.3), 0.0, log["duty_exhaust"])
    return log.with_columns(duty_supply=supply, duty_exhaust=exhaust)


@pytest.fixture(scope="module")
def off(driven) -> Log:
    """2 s whose position differs from the simulated one by a slow millimetre, so that every reset moves something."""
    log = driven(seconds=2.0)
    wrong = 1e-3 * (np.cos(2 * np.pi * log.time / 0.7) - 1) * (log.time > 0.1)
    return log.with_columns(position=np.maximum(log["position"] + wrong, 0.0))


def test_ballistic_sensitivities_to_every_parameter_are_exact_even_through_the_end_stop(truth, rough):
    assert simulate(truth, rough).log["position"].max() > 25.1e-3
    worst = mistaken(truth, rough)
    assert len(worst) == 55  # every number that is not 0
    assert {name: error for name, error in worst.items() if error > 1} == {}


@pytest.fixture(params=list(VARIANTS)[1:])
def rich(request) -> Actuator:
    """Every variant beyond the paper, see `richly`."""
    return richly(request.param)


@pytest.fixture(params=[None, *list(VARIANTS)[1:]], ids=str)
def every(request, truth) -> Actuator:
    """The paper's model with its own load, and every variant beyond it."""
    return truth if request.param is None else richly(request.param)


def richly(variant: str) -> Actuator:
    """Two chambers and two valves that are not alike, and a small reservoir."""
    parameters = Parameters(
        h_A=80.0, h_B=30.0, T_w=300.0, V_S=4e-3, tau_S=0.4, b_vs=0.35, m_vs=0.6, b_ve=0.25, m_ve=0.7, n_vs=1.2, n_ve=0.9
    )
    load = Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5)), knots=(0.0, 2e-3, 6e-3, 12e-3, 25e-3))
    return Actuator(parameters, load, variant)


def acting(actuator: Actuator) -> list[str]:
    """Parameters in the equations of an actuator, and its load weights."""
    return [*actuator.acting, *actuator.load.names]


def used_by(variant: str) -> set[str]:
    """Parameters that move a simulation of `variant` with averaged valves and not one of every other variant.

    A simulation starts with the governor at its mean, P_S, and stays there, whatever tau_G is.
    """
    stribeck = {"R_S", "v_S", "c_F"} if "stribeck" in variant else set()
    if not variant.startswith("energy"):
        return stribeck | {"B_vs", "B_ve"}
    valves = {f"{letter}_{valve}" for letter in "bmn" for valve in ("vs", "ve")}
    spools = {"tau_vs", "tau_ve"} if variant.endswith("proportional") else set()
    return stribeck | spools | valves | {"gamma", "T_w", "h_A", "h_B", "V_S", "tau_S", "F_h", "mu_h", "K_h", "C_A0"}


def test_sensitivities_of_every_variant_are_exact_through_valves_stop_and_both_kinds_of_friction(rich, rough):
    log = simulate(rich, rough).log
    assert log["position"].max() > 25.1e-3
    assert rough["duty_supply"].max() == rough["duty_exhaust"].max() == 1
    speed = np.abs(log["velocity"])
    v_S = rich.parameters.v_S
    for regime in (speed < v_S / 2, (speed > v_S / 2) & (speed < 2 * v_S), speed > 3 * v_S):  # sticks, fades, slides
        assert regime.sum() >= 10
    worst = mistaken(rich, rough)
    assert {name: error for name, error in worst.items() if error > 1} == {}
    whole = simulate(rich, rough, sensitivities=Parameters.names()).sensitivities
    beyond = used_by("isothermal") | used_by("energy-balance-stribeck-proportional")
    carrier = {"tau_G", "t_vs", "t_ve"}  # and what has no part in a simulation with averaged valves at all
    moving = {name for name in beyond | carrier if np.abs(whole[name]).max() > 0}
    assert moving == used_by(rich.model)


@pytest.mark.parametrize(("size", "carry"), [({"every": 50}, "q"), ({"parts": 7}, "p")], ids=["every-q", "parts-p"])
def test_partitioned_sensitivities_of_every_variant_are_exact(every, off, size, carry):
    # what acts on no equation of the variant stays without effect: the sensitivities above are those of all names
    worst = mistaken(every, off, partition=Partition(**size, carry=carry), names=acting(every))
    assert {name: error for name, error in worst.items() if error > 1} == {}


def test_sensitivities_of_a_start_under_pressure_are_exact_in_every_variant(every, driven):
    log = driven(seconds=3.0).slice(1000, 2500)
    worst = mistaken(every, log, names=acting(every))
    assert {name: error for name, error in worst.items() if error > 1} == {}
    other = replace(every, load=Load((9.0e5, -0.3e5, 0.6e5)))
    worst = mistaken(other, log, starts=[(14.2e-3, 4.6e5)], names=acting(other))
    assert {name: error for name, error in worst.items() if error > 1} == {}


#: Switched valves, whose period no number of samples fills, so that no edge lies on a sample; and a model of one's own.
OTHERS = {
    "switched": (
        Actuator(
            Parameters(T_pwm=0.0093, s_pwm=0.137, s_vs=0.21, s_ve=-0.17, t_vs=0.1, t_ve=0.1, a_0vs=0.05, a_0ve=0.05),
            model="energy-balance-stribeck",
        ),
        ("s_vs", "s_ve", "R_0vs", "R_1ve", "C_vs", "t_vs", "t_ve", "a_0vs", "a_0ve"),
    ),
    "own": (Actuator(model=own_model(EXAMPLE, "maxwell_slip")), ("K_2", "F_2")),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_sensitivities_through_switched_valves_and_of_an_own_model_are_exact(kind, rough):
    actuator, names = OTHERS[kind]
    whole = simulate(actuator, rough, sensitivities=names).sensitivities
    assert all(np.abs(whole[name]).max() > 0 for name in names)
    worst = mistaken(actuator, rough, names=names)
    assert {name: error for name, error in worst.items() if error > 1} == {}
