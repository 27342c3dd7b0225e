"""Laws of the plant of family B: balances, friction that only takes energy, limits by hand, order of the steps."""

import numpy as np
import pytest

from clutchid.truck import TruckB, load_curve
from clutchid.truck.assembly import at_rest
from clutchid.truck.compiled import compiled_plant
from clutchid.truck.load_table import LoadTable
from clutchid.truck.structure import LEDGER

STATES = TruckB.parts.structure.states

FREE = LoadTable(np.array([0.0]), np.zeros((2, 4)), 0.0, 0.0)


@pytest.fixture(scope="module", autouse=True)
def _compiled_loops() -> None:
    compiled_plant(TruckB.parts.structure, False)
    compiled_plant(TruckB.parts.structure, True)


def by_name(states: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip((*STATES, *LEDGER), states.T, strict=False))


def energy(t: TruckB, x: dict[str, np.ndarray]) -> np.ndarray:
    """Internal energy of the air in both zones and chamber B, and kinetic energy, in J."""
    V_A, V_B = t.V_0A + t.A_A * x["y"], t.V_0B + t.A_B * (t.y_max - x["y"])
    air = (x["p_A"] * V_A + x["p_D"] * t.V_D + x["p_B"] * V_B) / (t.gamma - 1)
    return air + 0.5 * t.M * x["v"] ** 2


def put(t: TruckB, y: float, p: float, curve: LoadTable) -> np.ndarray:
    """States with the piston at y and both zones at p, all air at the temperature of the wall."""
    start, T = at_rest(t, curve), t.T_0 + t.dT_w
    V_A, V_B = t.V_0A + t.A_A * y, t.V_0B + t.A_B * (t.y_max - y)
    start[:2] = y, 0.0
    for first, pressure, V in ((2, p, V_A), (4, p, t.V_D), (6, t.P_0, V_B)):
        start[first : first + 2] = pressure * V / (t.R * T), pressure
    return start


@pytest.mark.parametrize("kind", [{"valve": "spool"}, {"valve": "solenoids", "friction": "elasto-plastic"}])
def test_air_and_energy_that_cross_the_border_are_what_is_inside(lab, kind):
    t = TruckB(n_p=1.4, C_AB=2e-11, C_A0=1e-11, **kind)
    missing = []
    for substeps in (1, 2):
        x = by_name(lab.states(t, lab.forced(3000), substeps, True))
        mass = x["m_A"] + x["m_D"] + x["m_B"]
        # a sum of states: Runge-Kutta keeps it but for rounding, one unit of the last place of 5 g a step at most
        assert np.abs(mass - mass[0] - x["m_in"]).max() < 30000 * substeps * 1e-18
        stored = energy(t, x)
        missing.append(np.abs(stored - stored[0] - x["E_in"]).max() / np.ptp(x["E_in"]))
    # products of states: the integration error remains, and falls by 4 at least where the step is halved across kinks
    assert missing[0] < 1e-5
    assert missing[1] < missing[0] / 4


def test_a_vessel_that_fills_adiabatically_gains_the_enthalpy_of_the_air_that_enters(lab):
    t = TruckB(n_p=1.4, tau_w=1e9, V_S=1e6, C_AB=0.0, C_A0=0.0, A_r=0.0)
    start = put(t, t.y_max, 3e5, FREE)
    x = by_name(lab.states(t, np.tile([1.0, 0.0], (40, 1)), start=start, curve=FREE))
    entered = np.ptp(x["m_A"] + x["m_D"])
    V_A = t.V_0A + t.A_A * x["y"]
    gained = np.ptp(x["p_A"] * V_A + x["p_D"] * t.V_D) / 0.4
    assert entered > 5e-4
    # the piston sinks 0.2 mm into the far stop, against 7 kN: 1 J of 150 J at most
    assert gained == pytest.approx(1004.7 * t.T_0 * entered, rel=0.01)


def test_hot_air_that_leaves_the_dead_volume_for_a_cold_chamber_takes_its_own_heat_along(lab):
    t = TruckB(n_p=1.4, tau_w=1e9, C_AB=0.0, C_A0=0.0)
    start = put(t, 5e-3, 2e5, FREE)
    start[STATES.index("p_D")], start[STATES.index("m_D")] = 6e5, 6e5 * t.V_D / (t.R * 400.0)
    x = by_name(lab.states(t, np.zeros((8, 2)), start=start, curve=FREE))
    out = x["p_D"] > x["p_A"]
    assert out.sum() >= 3
    # an insulated vessel that empties keeps the entropy of each kilogram
    entropy = (x["p_D"] / x["m_D"] ** 1.4)[out]
    assert np.ptp(x["m_D"][out]) > 0.3 * x["m_D"][0]
    assert entropy == pytest.approx(entropy[0], rel=1e-4)


@pytest.mark.parametrize("kind", ["maxwell-slip", "elasto-plastic"])
def test_friction_only_takes_energy(lab, kind):
    t = TruckB(friction=kind, n_p=1.4, tau_w=1e9, C_AB=0.0, C_A0=0.0, A_r=0.0, C_t=4e-7)
    start = put(t, 6e-3, 4e5, FREE)
    start[STATES.index("p_D")], start[STATES.index("m_D")] = t.P_0, t.P_0 * t.V_D / (t.R * t.T_0)
    x = by_name(lab.states(t, np.zeros((600, 2)), 4, start=start, curve=FREE))
    stored = energy(t, x) + t.P_0 * (t.A_A - t.A_B) * x["y"]
    stored += 0.5 * t.K_b * x["z_b"] ** 2 + 0.5 * t.K_f * x["z_f"] ** 2
    parts = (0.4, 0.3, 0.2, 0.1) if kind == "maxwell-slip" else (1.0, 0.0, 0.0, 0.0)
    stored += sum(0.5 * k * t.K_z * x[f"z_{i}"] ** 2 for i, k in enumerate(parts, 1))
    assert x["v"].max() > 0.1
    # integration error: a billionth of what is stored
    assert np.diff(stored).max() < 1e-8 * stored[0]
    assert stored[0] - stored[-1] > 1.0


def test_sealed_air_that_is_warm_relaxes_to_the_pressure_of_the_cold_air(lab):
    t = TruckB(tau_w=0.3, C_AB=0.0, C_A0=0.0)
    x = by_name(lab.states(t, lab.forced(6000, ((10, 100, 1.0, 0.0),))))
    T = x["p_A"] * (t.V_0A + t.A_A * x["y"]) / (t.R * x["m_A"])
    assert T.max() > t.T_0 + t.dT_w + 15
    # 5.8 s are 19 time constants
    assert T[-1] == pytest.approx(t.T_0 + t.dT_w, abs=0.1)
    assert x["p_A"][-1] == pytest.approx(x["p_D"][-1], rel=1e-6)


def test_the_regulator_droops_while_the_chamber_fills_and_recovers_slowly(lab):
    t = TruckB()
    p = by_name(lab.states(t, lab.forced(4000, ((100, 400, 1.0, 0.0),))))["p_S"]
    assert 0.1e5 < t.P_S - p.min() < 0.6e5
    low = int(p.argmin())
    assert p[low + 50] < t.P_S - 0.3 * (t.P_S - p.min())
    assert p[-1] == pytest.approx(t.P_S, abs=0.05e5)


def test_the_tube_throttles_and_without_throttling_both_zones_have_one_pressure(lab):
    duties = lab.forced(300, ((10, 150, 1.0, 0.0),))
    narrow, wide = (by_name(lab.states(TruckB(C_t=C, dp_t=2e4), duties)) for C in (5e-8, 4e-7))
    apart = [np.abs(x["p_D"] - x["p_A"]).max() for x in (narrow, wide)]
    assert apart[0] > 2e5
    assert apart[1] < 0.2 * apart[0]


def test_halving_the_step_makes_the_error_sixteen_times_smaller(lab):
    # without kinks: seals and play stay elastic, no choking, chamber B sealed, always forwards, behind the touch point
    t = TruckB(
        P_S=6.5e5, F_C=5000.0, F_p=0.0, R_S=1.0, K_z=1e4, F_b=500.0, mu_b=0.0, mu_f=0.0, K_b=1e3, K_f=1e3, V_S=1e6,
        A_R=0.0, A_r=0.0, C_t=5e-8, V_D=3e-4, C_AB=0.0, C_A0=0.0, duty="continuous", spool="first-order", v_g=1e9,
    )  # fmt: skip
    curve = load_curve(t)
    y = 8e-3
    p = t.P_0 + (float(curve.force(np.array([y]))[0]) + 300) / t.A_A
    start = put(t, y, p, curve)
    start[4:6] *= 1.02

    def course(substeps):
        return lab.states(t, np.tile([0.5, 0.0], (60, 1)), substeps, start=start)

    exact = course(32)
    ratio = exact[:, STATES.index("p_D")] / t.P_S
    assert np.all((ratio > 0.53) & (ratio < t.r_lam))
    assert np.all(exact[1:, STATES.index("v")] > 0)
    for name in ("y", "v", "p_A", "p_D", "m_A"):
        i = STATES.index(name)
        errors = np.array([np.abs(course(k)[:, i] - exact[:, i]).max() for k in (1, 2, 4)])
        counted = errors > 1e-12 * np.abs(exact[:, i]).max()
        assert counted.sum() >= 2, name
        slope = -np.polyfit(np.log(np.array([1, 2, 4])[counted]), np.log(errors[counted]), 1)[0]
        # the next term is h lambda of the first, 0.1 ms times 2000 / s at most: it bends the slope by 0.2
        assert slope == pytest.approx(4, abs=0.3), name
