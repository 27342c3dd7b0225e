"""Common parts of the model variants: symbols, named definitions, openings of valves, forces on the piston, resets."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from clutchid.codegen.system import Expr, Jump, System, TabulatedFunction
from clutchid.model.chambers import volume_a, volume_b
from clutchid.model.friction import coulomb_force, deflection_rate, friction_force, stribeck_force
from clutchid.model.motion import stop_force
from clutchid.model.opening import (
    bridged_share,
    continued_share,
    fall,
    opening,
    passed_pulses,
    port_opening,
    pulse_share,
    switched_opening,
)
from clutchid.parameters import Parameters, in_order

#: Duty cycles, phase and step of the valves' carrier, and the duty cycles one period of it before.
VALVE_INPUTS = ("u_vs", "u_ve", "c_pwm", "d_pwm", "u_vs1", "u_ve1")


class Book:
    """Symbols by name; ``book.define(name, value)`` adds a named expression, in the order of computation."""

    def __init__(self, states: tuple[str, ...]) -> None:
        names = (*states, *Parameters.names(), *VALVE_INPUTS, "f_l", "y_measured", "p_A_measured")
        self._symbols: dict[str, Expr] = {name: sp.Symbol(name, real=True) for name in names}
        self.states = states
        self.rows: list[tuple[Expr, Expr]] = []

    def __getitem__(self, name: str) -> Expr:
        return self._symbols[name]

    def all(self, *names: str) -> tuple[Expr, ...]:
        """Several symbols."""
        return tuple(self._symbols[name] for name in names)

    def define(self, name: str, value: Expr) -> Expr:
        """The symbol `name` for the expression `value`."""
        symbol = self._symbols[name] = sp.Symbol(name, real=True)
        self.rows.append((symbol, value))
        return symbol


def openings(b: Book, switched: bool = False) -> None:
    """Opening degrees of both valves, Eq. (11); with `switched` as the carrier opens them."""
    for valve in ("vs", "ve"):
        u, R_0, R_1 = b.all(f"u_{valve}", f"R_0{valve}", f"R_1{valve}")
        if not switched:
            b.define(f"y_{valve}", opening(u, R_0, R_1))
            continue
        u_1, *law = b.all(f"u_{valve}1", f"R_0{valve}", f"R_1{valve}", f"a_0{valve}", f"t_{valve}")
        a_0, travel = law[2:]
        # each with a name of its own: conditions on what has cases itself would be multiplied out
        fallen = b.define(f"h_{valve}", fall(u_1, a_0, travel))
        alone, alone_1 = b.define(f"q_{valve}", pulse_share(u, *law)), b.define(f"q_{valve}1", pulse_share(u_1, *law))
        late = b.define(f"l_{valve}", pulse_share(sp.Integer(1), *law) - 1)
        before = b.define(f"c_{valve}", bridged_share(alone_1, u, fallen))
        share = b.define(f"a_{valve}", continued_share(alone, u, late, fallen))
        phase = b["s_pwm"] + b[f"s_{valve}"]
        passed = b.define(f"i_{valve}", passed_pulses(share, before, phase, travel, *b.all("c_pwm", "d_pwm")))
        b.define(f"y_{valve}", switched_opening(share, passed, *b.all("d_pwm", f"n_{valve}")))


def spool_openings(b: Book) -> None:
    """Opening degrees of proportional valves by the positions of their spools."""
    for valve in ("vs", "ve"):
        share = b.define(f"a_{valve}", opening(*b.all(f"x_{valve}", f"R_0{valve}", f"R_1{valve}")))
        b.define(f"y_{valve}", port_opening(share, b[f"n_{valve}"]))


def gated(opening_degree: Expr, flow: Expr) -> Expr:
    """A flow that is computed only while its valve is open."""
    return sp.Piecewise((opening_degree * flow, opening_degree > 0), (0, True))


def friction_and_stops(b: Book, stribeck: bool) -> None:
    """Rate of the deflection, friction and force of the end stops."""
    y, v, z = b.all("y", "v", "z")
    steady = b["F_C"]
    if stribeck:
        pressed = b.define("F_p", coulomb_force(b["p_A"], b["p_B"], b["F_C"], b["c_F"]))
        steady = b.define("F_g", stribeck_force(v, pressed, b["R_S"], b["v_S"]))
    z_dot = b.define("z_dot", deflection_rate(v, z, b["K_z"], steady))
    b.define("f_f", friction_force(v, z, z_dot, *b.all("D_v", "K_z", "D_zdot")))
    stop = b.all("K_stop", "D_stop", "d_stop")
    b.define("f_s", stop_force(y - b["y_max"], v, *stop) - stop_force(-y, -v, *stop))


def assembled(b: Book, name: str, inputs: Sequence[str], rates: tuple[Expr, ...]) -> System:
    """The system of the states and definitions of `b`, with the load as a table and the resets of partitions."""
    return System(
        name=name,
        states=b.all(*b.states),
        inputs=b.all(*inputs),
        parameters=b.all(*Parameters.names()),
        definitions=tuple(b.rows),
        derivatives=rates,
        table=TabulatedFunction(b["f_l"], b["y"]),
        measured=b.all("y_measured", "p_A_measured"),
        jumps=_resets(b),
        frequent=b.all(*in_order(Parameters.rows(), lambda row: row.adapts)),
    )


def _resets(b: Book) -> tuple[Jump, ...]:
    """Resets of partitioned simulation: the pressures (p) or the masses of air (q) go on; docs/deviations.md."""
    squeeze_a = volume_a(*b.all("y", "V_0A", "A_A")) / volume_a(*b.all("y_measured", "V_0A", "A_A"))
    squeeze_b = volume_b(*b.all("y", "V_0B", "A_B", "y_max")) / volume_b(*b.all("y_measured", "V_0B", "A_B", "y_max"))
    taken = {"y": b["y_measured"]}
    carried = {**taken, "p_A": b["p_A"] * squeeze_a, "p_B": b["p_B"] * squeeze_b}
    pressure = {"p_A": b["p_A_measured"]}
    kinds = {"p": taken, "q": carried, "p, pressure": taken | pressure, "q, pressure": carried | pressure}
    return tuple(Jump(name, tuple(new.get(x, b[x]) for x in b.states)) for name, new in kinds.items())
