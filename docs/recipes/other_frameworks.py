"""The equations as a JAX function or a CasADi function: ``rate_in_jax(actuator)``, ``rate_in_casadi(actuator)``.

Both are the right-hand side of the model of an actuator in SI, from the text that also makes its kernels and its C:
states in the order of ``actuator.states``, inputs in that of ``system(actuator.model).inputs`` (the duty cycles of
supply and exhaust valve come first), and the parameters of `PARAMETERS`, in which they can be differentiated. The load
is the table of the actuator.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sympy as sp

import clutchid
from clutchid.model.compiled import system

#: Parameters that stay symbols; all others have the values of the actuator.
PARAMETERS = ("P_S", "C_vs", "C_ve", "F_C", "D_v", "M")


def expressions(actuator: clutchid.Actuator) -> tuple[list[sp.Symbol], list[sp.Expr]]:
    """Arguments, and definitions followed by the right-hand sides, with the values of fixed parameters."""
    text = system(actuator.model)
    values = {p: actuator.value(str(p)) for p in text.parameters if str(p) not in PARAMETERS}
    free = [next(p for p in text.parameters if str(p) == name) for name in PARAMETERS]
    rows = [value.xreplace(values) for _, value in text.definitions] + [d.xreplace(values) for d in text.derivatives]
    return [*text.states, *text.inputs, *free, text.table.value, *(name for name, _ in text.definitions)], rows


def evaluated(
    actuator: clutchid.Actuator, modules: Sequence[Any], load: Callable[[Any], Any]
) -> Callable[..., list[Any]]:
    """``f(states, inputs, parameters)`` in the numbers of `modules`, one definition after the other."""
    text = system(actuator.model)
    symbols, rows = expressions(actuator)
    count = len(text.definitions)
    outer = symbols[: len(symbols) - count]
    steps = [sp.lambdify([*outer, *symbols[len(outer) : len(outer) + min(k, count)]], row, modules=list(modules))
             for k, row in enumerate(rows)]  # fmt: skip
    place = text.states.index(text.table.argument)

    def rate(states: Any, inputs: Any, parameters: Any) -> list[Any]:
        n = len(text.states)
        values = [*(states[i] for i in range(n)), *(inputs[i] for i in range(len(text.inputs)))]
        values += [*(parameters[i] for i in range(len(PARAMETERS))), load(states[place])]
        for step in steps[:count]:
            values.append(step(*values))
        return [step(*values) for step in steps[count:]]

    return rate


def rate_in_jax(actuator: clutchid.Actuator) -> Callable[[Any, Any, Any], Any]:
    """Right-hand side for JAX: compile it with `jax.jit`, differentiate it with `jax.jacfwd`."""
    import jax.numpy as jnp

    breaks, powers = map(jnp.asarray, (actuator.load.breakpoints, actuator.load.coefficients))
    weighted = jnp.einsum("i,isk->sk", jnp.asarray(actuator.load.theta), powers)

    def load(y: Any) -> Any:
        segment = jnp.searchsorted(breaks, y, side="right")
        u = y - breaks[jnp.maximum(segment - 1, 0)]
        return weighted[segment] @ jnp.array([1.0, u, u**2, u**3])

    rate = evaluated(actuator, ["jax"], load)
    return lambda x, u, p: jnp.array(rate(x, u, p))


def rate_in_casadi(actuator: clutchid.Actuator) -> Any:
    """Right-hand side as a CasADi `Function` of states, duty cycles and parameters."""
    import casadi as ca

    breaks, powers = actuator.load.breakpoints, actuator.load.coefficients
    weighted = np.einsum("i,isk->sk", actuator.load.theta, powers)

    def load(y: Any) -> Any:
        value = sum(weighted[0, k] * (y - breaks[0]) ** k for k in range(4))
        for s, start in enumerate(breaks):
            value = ca.if_else(y >= start, sum(weighted[s + 1, k] * (y - start) ** k for k in range(4)), value)
        return value

    def piecewise(conditions: Sequence[Any], values: Sequence[Any]) -> Any:
        value = values[-1]
        for condition, other in list(zip(conditions, values, strict=True))[-2::-1]:
            value = ca.if_else(condition, other, value)
        return value

    words = {"select": lambda conditions, values, default=0: piecewise([*conditions, True], [*values, default]),
             "sqrt": ca.sqrt, "Abs": ca.fabs, "exp": ca.exp, "log": ca.log, "tanh": ca.tanh,
             "Min": ca.fmin, "Max": ca.fmax, "less": lambda a, b: a < b, "greater": lambda a, b: a > b,
             "less_equal": lambda a, b: a <= b, "greater_equal": lambda a, b: a >= b}  # fmt: skip
    n, m = len(system(actuator.model).states), len(system(actuator.model).inputs)
    x, u, p = ca.SX.sym("x", n), ca.SX.sym("u", m), ca.SX.sym("p", len(PARAMETERS))
    rate = evaluated(actuator, [words, "numpy"], load)
    return ca.Function("rate", [x, u, p], [ca.vertcat(*rate(x, u, p))])
