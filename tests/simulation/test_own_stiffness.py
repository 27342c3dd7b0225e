"""The integration is stable for models of one's own: stiffness is that of own states where they settle."""

import numpy as np
import pytest
from sympy import Piecewise, symbols

from clutchid.log import Log
from clutchid.model import Actuator, OwnModel, OwnParameter, OwnState
from clutchid.simulation import simulate
from clutchid.simulation.stiffness import TOP_SPEED, stiffness

v, z_2, f_f, K_2, F_2 = symbols("v z_2 f_f K_2 F_2")
ELEMENT = OwnModel(
    "isothermal",
    parameters={
        "K_2": OwnParameter(1e6, "N/m", "stiffness", range=(1e3, 1e9)),
        "F_2": OwnParameter(20, "N", "slip force", range=(1, 1e4)),
    },
    states={"z_2": OwnState("m", "deflection", scale=1e-4)},
    rates={"z_2": Piecewise((v * (1 - (K_2 * z_2 / F_2) ** 2), v * z_2 > 0), (v, True))},
    terms={"f_f": f_f + K_2 * z_2},
)


@pytest.mark.parametrize("slips_at", [5.0, 20.0])
def test_the_fastest_mode_of_a_friction_element_is_that_of_its_slipping(slips_at):
    # d/dz of v (1 - (K z / F)²) at z = F / K; it is uncoupled but for the piston's 316 1/s
    expected = 2 * TOP_SPEED * 1e6 / slips_at
    assert stiffness(Actuator(model=ELEMENT).replace({"F_2": slips_at})) == pytest.approx(expected, rel=0.01)


def test_a_stiff_element_is_integrated_with_as_many_steps_as_it_needs():
    t = np.arange(0.0, 0.3, 1e-3)
    stroke = Log(t, {"duty_supply": 1.0 * (t > 0.05), "duty_exhaust": np.zeros(t.size)})
    log = simulate(Actuator(model=ELEMENT).replace({"F_2": 5.0}), stroke).log
    slipping = log["velocity"] > 0.1
    assert slipping.sum() > 50
    # what is stable settles at F / K = 5 µm; a change of v by a tenth within a sample moves it by less
    np.testing.assert_allclose(log["z_2 [m]"][slipping], 5e-6, rtol=0.01)
