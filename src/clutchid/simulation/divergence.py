"""Message of a simulation that diverges: time, state, and the term of the equations that makes it diverge."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.plan import Segment


class _Term(NamedTuple):
    name: str
    value: float
    parameters: tuple[str, ...]
    made_of: tuple[str, ...]


def failing_term(actuator: Actuator, state: FloatArray, inputs: FloatArray) -> str:
    """The first term of the equations that is not finite at `state`, with its arguments, as a sentence.

    If all are finite: the state that changes fastest relative to its `State.fast`.

    Parameters
    ----------
    state, inputs
        Of the variant, in SI, in the order of its kernels.

    Examples
    --------
    Below absolute zero no air flows out:

    >>> state = np.array([1e-3, 0.0, 2e5, 1.1e5, 0.0, -5.0, 293.0, 9e5, 9e5, 0.0])
    >>> failing_term(Actuator(model="energy-balance"), state, np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0]))[:67]
    'the term w_ve is not finite; it depends on p_A = 2e+05, T_A = -5, y'
    """
    values = dict(zip(actuator.states, state.tolist(), strict=True))
    rates: list[_Term] = []
    for term in _terms(actuator, state, inputs):
        if not math.isfinite(term.value):
            what = f"rate of {term.name[2:]}" if term.name.startswith("d_") else f"term {term.name}"
            return f"the {what} is not finite{_made_of(actuator, term, values)}"
        values[term.name] = term.value
        rates += [term] if term.name.startswith("d_") else []
    rows = actuator.state_rows
    fastest = max(rates, key=lambda term: abs(term.value) / rows[term.name[2:]].fast)
    name, unit = fastest.name[2:], rows[fastest.name[2:]].rate_unit
    what = f"all terms are finite and {name} changes fastest, by {fastest.value:.3g} {unit}"
    return what + _made_of(actuator, fastest, values)


def _terms(actuator: Actuator, state: FloatArray, inputs: FloatArray) -> Iterator[_Term]:
    """The load and every term; the last one is NaN if it cannot be computed."""
    module, load = kernels(actuator.model), actuator.load
    y = state[[actuator.states.index("y")]]
    with np.errstate(all="ignore"):
        force = float(load.force(y)[0])
        acting = tuple(name for name, phi in zip(load.names, load.phi(y)[0], strict=True) if phi != 0.0)
    yield _Term("f_l", force, acting, ())
    values = module.terms(state.tolist(), inputs.tolist(), actuator.array().tolist(), force)
    for name, parameters, made_of in module.TERMS:
        try:
            yield _Term(name, next(values), parameters, made_of)
        except (ArithmeticError, ValueError):  # Python raises where the kernels return NaN
            yield _Term(name, math.nan, parameters, made_of)
            return


def _made_of(actuator: Actuator, term: _Term, values: Mapping[str, float]) -> str:
    """The states, terms and parameters that a term depends on, with their values."""
    shown = [f"{name} = {values[name]:.3g}" for name in term.made_of]
    shown += [f"{name} = {actuator.value(name):g}{actuator.unit_behind(name)}" for name in term.parameters]
    return f"; it depends on {', '.join(shown)}" if shown else ""


def failure_message(
    log: Log,
    segment: Segment,
    states: FloatArray,
    failed: int,
    names: Sequence[str],
    actuator: Actuator | None = None,
) -> str:
    """Message of a diverged simulation: time and state, and the `failing_term` of the `actuator`, if given."""
    bad = [name for name, value in zip(names, states[failed], strict=True) if not np.isfinite(value)]
    time = log.time[segment.start + failed]
    why = ""
    if actuator is not None and failed > 0:
        last = log.time[segment.start + failed - 1]
        why = f"; at {last:.3f} s {failing_term(actuator, states[failed - 1], segment.inputs[failed - 1])}"
    return (
        f"{log.name}: the simulation diverged at {time:.3f} s in {', '.join(bad) or 'all states'}{why}; "
        "try other start values or check the units of the recording."
    )
