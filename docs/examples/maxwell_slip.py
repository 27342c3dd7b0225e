"""Maxwell slip in place of the LuGre seal, a return spring, and another valve characteristic."""

from sympy import Piecewise, symbols

from clutchid.model import OwnModel, OwnParameter, OwnState

# of the variant (docs/equations.md): position, velocity, viscous friction, force of the end stops, opening of a valve
y, v, D_v, f_s, y_vs = symbols("y v D_v f_s y_vs")
# our own
z_1, z_2, K_1, K_2, F_1, F_2, D_z, K_r, F_r, k_vs = symbols("z_1 z_2 K_1 K_2 F_1 F_2 D_z K_r F_r k_vs")


def slip_rate(z, K, F):
    """Rate of an element that moves along with the piston until its force K z is F, and slips from then on."""
    used = (K * z / F) ** 2  # the part of the force that is used up; the square makes the change smooth
    return Piecewise((v * (1 - used), v * z > 0), (v, True))


rate_1, rate_2 = slip_rate(z_1, K_1, F_1), slip_rate(z_2, K_2, F_2)

maxwell_slip = OwnModel(
    base="isothermal",
    without=("z",),  # the deflection of the LuGre seal
    parameters={
        "K_1": OwnParameter(8e5, "N/m", "stiffness of element 1", range=(1e4, 1e8), std=2e5),
        "F_1": OwnParameter(120, "N", "slip force of element 1", range=(1, 1e4), std=40, drift=10),
        "K_2": OwnParameter(2e5, "N/m", "stiffness of element 2", range=(1e4, 1e8), std=5e4),
        "F_2": OwnParameter(80, "N", "slip force of element 2", range=(1, 1e4), std=30, drift=5),
        "D_z": OwnParameter(2500, "N·s/m", "damping of the elements", range=(0, 1e6)),
        # no prior: what a spring does, a load does as well, so its values are those of its drawing
        "K_r": OwnParameter(4e3, "N/m", "stiffness of the return spring", range=(0, 1e5)),
        "F_r": OwnParameter(50, "N", "force of the return spring at y = 0", range=(0, 1e3)),
        "k_vs": OwnParameter(1.2, "1", "exponent of the supply valve's opening", range=(0.5, 3), std=0.2),
    },
    states={
        "z_1": OwnState("m", "deflection of element 1", scale=2e-4),
        "z_2": OwnState("m", "deflection of element 2", scale=4e-4),
    },
    rates={"z_1": rate_1, "z_2": rate_2},
    terms={
        "f_f": D_v * v + K_1 * z_1 + K_2 * z_2 + D_z * (rate_1 + rate_2),
        "f_s": f_s + F_r + K_r * y,  # the end stops as before, and the spring
        "y_vs": Piecewise((y_vs**k_vs, y_vs > 0), (0, True)),
    },
)
