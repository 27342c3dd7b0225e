"""Laws of the plant: nothing is lost or made, entropy never falls, air flows downhill, stops never pull."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from clutchid.truck import Truck, aged, load_curve
from clutchid.truck.assembly import at_rest
from clutchid.truck.compiled import compiled_plant
from clutchid.truck.equations.flow import flow_function, orifice_flow, slit_flow, valve_flow
from clutchid.truck.equations.motion import stop_force
from clutchid.truck.equations.reservoir import line_flow
from clutchid.truck.load_table import LoadTable
from clutchid.truck.structure import LEDGER

STATES = Truck.parts.structure.states

pytestmark = pytest.mark.slow

LEAKY = Truck(C_AB=2e-11, C_A0=1e-11)


@pytest.fixture(scope="module", autouse=True)
def _compiled_books() -> None:
    compiled_plant(Truck.parts.structure, True)


def books(states: np.ndarray, truck: Truck) -> tuple[np.ndarray, np.ndarray, float]:
    """What is missing in the books of air [kg] and energy [J], and the energy that went through them."""
    x = dict(zip((*STATES, *LEDGER), states.T, strict=True))
    mass = x["m_A"] + x["m_B"] + x["m_S"]
    energy = x["U_A"] + x["U_B"] + x["U_S"] + 0.5 * truck.M * x["v"] ** 2
    return mass - mass[0] - x["m_in"], energy - energy[0] - x["E_in"], float(np.ptp(x["E_in"]))


@pytest.mark.parametrize(
    "truck", [Truck(), LEAKY, aged(Truck(T_0=250.0), wear=2e-3, cycles=1e6)], ids=["new", "leaky", "old"]
)
def test_air_and_energy_that_cross_the_border_are_what_is_inside(lab, truck):
    duties = lab.forced(3000)
    mass, energy, through = books(lab.states(truck, duties, 1, True), truck)
    finer_mass, finer, _ = books(lab.states(truck, duties, 2, True), truck)
    # air is a sum of states: Runge-Kutta keeps it but for rounding, one unit of the last place of the reservoir a step
    rounding = np.finfo(float).eps * 30000 * truck.P_S * truck.V_S
    assert np.abs(mass).max() < rounding / (truck.R * truck.T_0)
    assert np.abs(finer_mass).max() < 2 * rounding / (truck.R * truck.T_0)
    # energy has a square in it (M v^2 / 2): the integration error remains, 16 times less with half the step where all
    # is smooth, at least 4 times less across kinks; below that only rounding of U_S
    rounding /= truck.gamma - 1
    assert np.abs(energy).max() < 1e-9 * through + rounding
    assert np.abs(finer).max() < np.abs(energy).max() / 4 + 2 * rounding


def closed(truck: Truck) -> Truck:
    """`truck` with insulated walls, sealed valves and no way out of chamber B but the leak."""
    return truck.replace({"h_A": 0.0, "h_B": 0.0, "C_s": 0.0, "C_e": 0.0, "C_r": 0.0, "C_A0": 0.0})


@pytest.mark.parametrize("leak", [0.0, 2e-11])
def test_entropy_never_falls_in_closed_insulated_chambers(lab, leak):
    truck = closed(Truck(C_AB=leak))
    start = lab.put(truck, at_rest(truck, load_curve(truck)), 6e-3, 8e5)
    total = []
    for substeps in (1, 2):
        states = lab.states(truck, np.zeros((400, 2)), substeps, start=start)
        total.append(lab.entropy(truck, states, "A") + lab.entropy(truck, states, "B"))
    assert np.ptp(states[:, 0]) > 5e-3  # the piston springs over a fifth of its stroke
    # the integration error of the coarse run is at most 16/15 of its distance to the fine one; and rounding
    error = 2 * 16 / 15 * np.abs(total[0] - total[1]).max() + 1e-14 * np.abs(total[0]).max()
    assert np.diff(total[0]).min() > -error
    if leak:
        assert total[0][-1] - total[0][0] > 100 * error
    else:
        assert abs(total[0][-1] - total[0][0]) < error


_r, _b, _m, _l, _p, _q, _C, _T = sp.symbols("r b m l p q C T", positive=True)
psi = sp.lambdify((_r, _b, _m, _l), flow_function(_r, _b, _m, _l), "math")
valve = sp.lambdify((_p, _q, _T, _C), valve_flow(_p, _q, _T, _C, 0.3, 0.55, 0.995), "math")


def one_way(p, q, T, sign):
    return sign * valve_flow(p, q, T, _C, 0.3, 0.55, 0.995)


orifice = sp.lambdify((_p, _q, _T, _C), orifice_flow(one_way, _p, _q, _T, 280), "math")
slit = sp.lambdify((_p, _q, _T, _C), slit_flow(_p, _q, _T, _C), "math")
line = sp.lambdify((_p, _q, _C), line_flow(_p, _q, _C), "math")
_d, _v = sp.symbols("d v", real=True)
stop = sp.lambdify((_d, _v), stop_force(_d, _v, 1.15e9, 4.0), "math")
pressure = st.floats(5e4, 1.5e6)
kelvin = st.floats(200, 450)
conductance = st.floats(0, 1e-6)


@given(pressure, pressure, kelvin, conductance)
def test_air_never_flows_uphill(p, q, T, C):
    assert valve(p, q, T, C) >= 0
    assert line(p, q, C) >= 0
    assert orifice(p, q, T, C) * (p - q) >= 0
    assert slit(p, q, T, C) * (p - q) >= 0
    if q >= p:
        assert valve(p, q, T, C) == 0
        assert line(p, q, C) == 0


@given(st.floats(0, 1.5), st.floats(0, 0.6), st.floats(0.3, 3), st.floats(0.95, 0.9999))
def test_the_flow_function_is_that_of_the_standard_and_a_straight_line_to_zero(r, b, m, r_lam):
    standard = (1 - (max(0.0, min(r, r_lam) - b) / (1 - b)) ** 2) ** m
    line = 1.0 if r <= r_lam else max(0.0, (1 - r) / (1 - r_lam))
    assert psi(r, b, m, r_lam) == pytest.approx(standard * line, rel=1e-12, abs=1e-12)


@given(st.floats(-1e-2, 1e-3), st.floats(-2, 2))
def test_an_end_stop_acts_on_one_side_grows_with_the_power_of_its_depth_and_never_pulls(d, v):
    expected = 1.15e9 * max(0.0, d) ** 1.5 * max(0.0, 1 + 4.0 * v)
    assert stop(d, v) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_the_piston_stays_between_its_stops(lab):
    truck = Truck(P_S=10e5)
    y = lab.states(truck, lab.forced(1500, ((10, 600, 1.0, 0.0), (600, 1500, 0.0, 1.0))))[:, 0]
    # 11 kN of air on a contact of 1.15e9 N/m^1.5: 0.45 mm at rest, twice the force at an impact 0.72 mm
    assert y.max() < truck.y_max + 0.72e-3
    assert y.max() > truck.y_max
    assert y.min() > -0.1e-3


def test_friction_only_takes_energy(lab):
    curve = LoadTable(np.array([0.0]), np.zeros((2, 4)), 0.0, 0.0)
    truck = closed(Truck(C_AB=0.0))
    start = lab.put(truck, at_rest(truck, curve), 6e-3, 4e5)
    states = lab.states(truck, np.zeros((600, 2)), 4, start=start, curve=curve)
    p_A, p_B, _ = lab.pressures(truck, states)
    y, v, z, z_h = (states[:, STATES.index(name)] for name in ("y", "v", "z", "z_h"))
    stored = states[:, 3] + states[:, 5] + 0.5 * truck.M * v**2 + 0.5 * truck.K_z * z**2 + 0.5 * truck.K_h * z_h**2
    stored += truck.P_0 * (truck.A_A - truck.A_B) * y
    assert v.max() > 0.1
    # what is stored in air, motion and bristles never rises; 1e-10 of it is integration error
    assert np.diff(stored).max() < 1e-9 * stored[0]
    assert stored[0] - stored[-1] > 1.0
    assert p_A[-1] > p_B[-1] > truck.P_0
