"""`OwnModel`: simulation and derivatives of physics of one's own, and one clear sentence for what does not fit."""

import pickle

import numpy as np
import pytest
from sympy import Function, Piecewise, symbols

from clutchid.errors import ParameterError
from clutchid.log import Log
from clutchid.log.states import STATES
from clutchid.model import Actuator, OwnModel, OwnParameter, OwnState
from clutchid.model.compiled import system
from clutchid.model.own.units import TERM_UNITS, dimension_of
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from fixtures.sentences import one_sentence

pytestmark = pytest.mark.slow

y, v, z, z_2, f_f, f_s, y_vs, u_vs, K_2, F_2, c_r, F_r, m_v = symbols(
    "y v z z_2 f_f f_s y_vs u_vs K_2 F_2 c_r F_r m_v", real=True
)
STIFFNESS = OwnParameter(2e5, "N/m", "stiffness of the element", range=(1e4, 1e7), std=1e5)
SLIP = OwnParameter(80, "N", "slip force of the element", range=(1, 1e4), std=30)
DEFLECTION = OwnState("m", "deflection of the element", scale=4e-4)


def spring(**changes):
    """The paper's model with a return spring, with other fields."""
    fields = {
        "base": "isothermal",
        "parameters": {
            "c_r": OwnParameter(4e3, "N/m", "stiffness of the return spring", range=(0, 1e5), std=2e3),
            "F_r": OwnParameter(50, "N", "preload of the return spring", range=(0, 1e3)),
        },
        "terms": {"f_s": f_s + F_r + c_r * y},
    }
    return OwnModel(**{**fields, **changes})


def element(**changes):
    """The paper's model with one elasto-slide element beside the seal."""
    rate = Piecewise((v * (1 - (K_2 * z_2 / F_2) ** 2), v * z_2 > 0), (v, True))
    fields = {
        "base": "isothermal",
        "parameters": {"K_2": STIFFNESS, "F_2": SLIP},
        "states": {"z_2": DEFLECTION},
        "rates": {"z_2": rate},
        "terms": {"f_f": f_f + K_2 * z_2},
    }
    return OwnModel(**{**fields, **changes})


def stiff(*arguments, **entries):
    """The element with another stiffness."""
    return element(parameters={"K_2": OwnParameter(*arguments, **entries), "F_2": SLIP})


@pytest.fixture(scope="module")
def stroke() -> Log:
    """Out by 8 mm, a hold, and back."""
    t = np.arange(0.0, 0.8, 1e-3)
    return Log(t, {"duty_supply": 1.0 * ((t > 0.05) & (t < 0.12)), "duty_exhaust": 1.0 * (t > 0.4)})


def test_a_spring_without_stiffness_changes_nothing(stroke):
    loose = Actuator(model=spring()).replace({"c_r": 0.0, "F_r": 0.0})
    ours, paper = simulate(loose, stroke).log, simulate(Actuator(), stroke).log
    assert list(ours.columns) == list(paper.columns)
    for name in ours.columns:
        # sums are taken in another order: 800 roundings of 1e-16, which a mode of 2400 1/s cannot enlarge
        np.testing.assert_allclose(ours[name], paper[name], rtol=1e-9, atol=1e-9 * np.abs(paper[name]).max())


def test_a_spring_holds_the_piston_back_by_its_force(stroke):
    """While the piston creeps in equilibrium, the load less the spring is what pressure and friction leave."""
    actuator = Actuator(model=spring())
    log = simulate(actuator, stroke).log
    p, at = actuator.parameters, 380
    friction = p.D_v * log["velocity"][at] + p.K_z * log["deflection"][at]
    force = p.A_A * (log["pressure_a"][at] - p.P_0) - p.A_B * (log["pressure_b"][at] - p.P_0) - friction
    spring_force = 50 + 4e3 * log["position"][at]
    # what is left accelerates 10 kg; a hold of 0.26 s leaves less than 0.1 m/s²
    assert force - actuator.load.force(log["position"][[at]])[0] == pytest.approx(spring_force, abs=1.0)


def test_the_simulation_has_the_own_state_with_its_unit(stroke):
    log = simulate(Actuator(model=element()), stroke).log
    # an element slips where its force is F_2, which bounds its deflection
    assert 0.9 * 80 / 2e5 < np.abs(log["z_2 [m]"]).max() < 1.01 * 80 / 2e5


def test_a_state_that_is_left_out_takes_its_parameters_along():
    own = element(without=("z",), terms={"f_f": K_2 * z_2})
    actuator = Actuator(model=own)
    assert actuator.states == ("y", "v", "p_A", "p_B", "z_2")
    assert not {"K_z", "F_C", "D_zdot", "D_v"} & actuator.in_equations
    assert {"K_2", "F_2", "D_stop"} <= actuator.in_equations


def test_another_valve_characteristic_replaces_the_opening(stroke):
    curved = OwnModel(
        "isothermal",
        parameters={"m_v": OwnParameter(1.0, "1", "exponent of the opening", range=(0.5, 3), std=0.3)},
        terms={"y_vs": Piecewise((y_vs**m_v, y_vs > 0), (0, True))},
    )
    same = simulate(Actuator(model=curved), stroke).log["position"]
    # full pulses open fully whatever the exponent; pow(x, 1) may round
    np.testing.assert_allclose(same, simulate(Actuator(), stroke).log["position"], rtol=0, atol=1e-12)
    partial = stroke.with_columns(duty_supply=0.5 * stroke["duty_supply"])
    late = simulate(Actuator(model=curved).replace({"m_v": 2.0}), partial).log["position"].max()
    assert late < 0.8 * simulate(Actuator(), partial).log["position"].max()


def test_own_physics_stand_on_every_variant(stroke):
    for variant in VARIANTS:
        names = [str(s) for s in system(spring(base=variant)).states]
        assert names == [str(s) for s in system(variant).states]


def test_an_actuator_with_an_own_model_travels_to_another_process():
    actuator = Actuator(model=element()).replace({"K_2": 3e5})
    again = pickle.loads(pickle.dumps(actuator))
    assert again == actuator
    assert hash(again) == hash(actuator)
    assert again.value("K_2") == 3e5


def test_the_hash_is_of_the_meaning():
    assert spring().sha256 == spring(name="other").sha256
    assert spring().sha256 == spring(terms={"f_s": F_r + y * c_r + f_s}).sha256
    bare = symbols("y f_s c_r F_r")
    assert spring().sha256 == spring(terms={"f_s": bare[1] + bare[3] + bare[2] * bare[0]}).sha256
    others = [spring(terms={"f_s": f_s + F_r + 2 * c_r * y}), spring(base="energy-balance"), element()]
    assert len({spring().sha256, *(other.sha256 for other in others)}) == 4


def test_values_outside_their_range_are_refused_with_the_range():
    actuator = Actuator(model=spring())
    with pytest.raises(
        ParameterError, match=r"^c_r = -1 N/m: it must be at least 0 and at most 100000\. The default is 4000\.$"
    ):
        actuator.replace({"c_r": -1.0})
    with pytest.raises(ParameterError, match="did you mean 'c_r'"):
        actuator.value("c_R")
    assert actuator.row("c_r").meaning == "stiffness of the return spring"
    assert actuator.unit("F_r") == "N"
    assert actuator.default("F_r") == 50.0


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: spring(base="isotherm"), "base: no model variant 'isotherm'; did you mean 'isothermal'?"),
        (lambda: element(rates={}), "rates: z_2: missing; give the rate of change of every new state."),
        (lambda: element(rates={"z_2": v, "q": v}), "rates: no state 'q'"),
        (lambda: stiff(2e5, "N/m", "x"), "parameter K_2: no admissible range; give range=(SMALLEST, LARGEST)"),
        (
            lambda: element(parameters={"K_2": STIFFNESS, "F_2": SLIP, "F_C": SLIP}),
            "parameter F_C: the name is taken, by a parameter of clutchid; choose another one.",
        ),
        (
            lambda: element(states={"z_2": DEFLECTION, "z": DEFLECTION}, rates={"z_2": v, "z": v}),
            "state z: the name is taken, by a state of clutchid; choose another one.",
        ),
        (lambda: stiff(2e5, "N/mm", "x", (0, 1e9)), (
            "parameter K_2: unit 'N/mm': 'mm' is not an SI unit; the known units are 1"
        )),
        (lambda: element(terms={"f_f": f_f + K_2 * v}), "terms: f_f: the units do not fit: K_2*v + f_f_base combines"),
        (lambda: element(terms={"f_f": K_2 * z_2 / F_2}), "terms: f_f: the expression is in 1; N is needed."),
        (lambda: element(rates={"z_2": z_2 * K_2 / F_2}), "rates: z_2: the expression is in 1; m/s is needed."),
        (
            lambda: spring(terms={"f_s": f_s + symbols("F_R") + c_r * y}),
            "terms: f_s: 'F_R' is not a state, input, parameter or term; did you mean 'F_r'?",
        ),
        (lambda: spring(terms={"f_S": F_r + c_r * y}), "terms: f_S: no equation uses it; did you mean 'f_s'?"),
        (lambda: spring(terms={"f_s": "F_r + c_r*y"}), "terms: f_s = 'F_r + c_r*y': a SymPy expression"),
        (lambda: spring(terms={"f_s": Function("erf")(y)}), "terms: f_s: no erf() in this language; known are sqrt"),
        (
            lambda: spring(terms={"f_s": f_s + Piecewise((F_r + c_r * y, y > 0))}),
            "terms: f_s: value_1: a piecewise expression must end with a branch for every other case.",
        ),
        (
            lambda: spring(terms={"f_s": symbols("q"), "q": F_r + c_r * y + symbols("f_s")}),
            "terms depend on each other: f_s -> q -> f_s.",
        ),
        (lambda: spring(terms={"f_s": f_s + F_r}), "parameter c_r: stands in no equation that is used"),
        (lambda: spring(without=("z",)), "without: z: still used by z_dot, f_f; replace these too."),
        (lambda: spring(without=("p_A",)), "without: p_A: of the states of isothermal, z can be left out."),
        (lambda: spring(name="my model"), "model 'my model': a name has letters, digits and _"),
        (
            lambda: element(states={"z_2": OwnState("m", "deflection", scale=0.0)}),
            "state z_2: scale = 0.0 m: the size that it reaches is above 0 and finite.",
        ),
        (
            lambda: element(states={"z_2": OwnState("m", "deflection", scale=1e-4, start="P_0")}),
            "state z_2: start = 'P_0' has the unit Pa, the state has m.",
        ),
        (
            lambda: stiff(0.5, "N/m", "x", (1, 1e4)),
            "parameter K_2: default = 0.5 N/m: it must be at least 1 and at most",
        ),
        (lambda: stiff("much", "N/m", "x", (0, 1e9)), "parameter K_2: default = 'much': a number is needed."),
        (lambda: element(rates=[v]), "rates = [v]: a dictionary by name is needed."),
        (lambda: spring(without="z"), "without = 'z': a tuple of names is needed, ('z',)."),
        (lambda: element(parameters={"K_2": 2e5, "F_2": SLIP}), "parameters: K_2 = 200000.0: write OwnParameter(...)."),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_sentence(make, sentence):
    assert one_sentence(ParameterError, make).startswith(sentence)


def test_all_problems_are_named_at_once():
    with pytest.raises(ParameterError) as caught:
        element(parameters={"K_2": OwnParameter(1.0, "bar", "stiffness"), "F_C": SLIP}, rates={})
    assert len(str(caught.value).splitlines()) >= 4


def test_every_term_that_can_be_replaced_has_a_unit():
    terms = {str(symbol) for variant in VARIANTS for symbol, _ in system(variant).definitions}
    inputs = {str(symbol) for variant in VARIANTS for symbol in system(variant).inputs}
    assert terms | inputs | {"f_l"} == set(TERM_UNITS)


def test_every_unit_of_the_package_is_a_unit_of_an_own_model():
    units = {Parameters.row(name).unit for name in Parameters.names()} | {state.unit for state in STATES.values()}
    assert all(len(dimension_of(unit)) == 4 for unit in units)
    assert dimension_of("W/(m²·K)") == dimension_of("kg/(s^3*K)")
