"""The load in a parameter file: basis and knots under ``[model]``, weights among the parameters."""

from __future__ import annotations

from typing import Any

from clutchid.errors import ParameterError
from clutchid.estimation.model_section import MODEL_KEYS
from clutchid.model.b_spline import DEFAULT_KNOTS
from clutchid.model.weighted_load import BASES, MOST_KNOTS, Load
from clutchid.names import unknown_name, unknown_names
from clutchid.parameters import is_number

_LOAD_KEYS = ("load_basis", "knots", "phi2_slope")


def load_in(model: dict[str, Any], values: dict[str, Any], *, defaults: bool = True) -> tuple[Load | None, list[str]]:
    """The load of a section ``[model]`` with the weights among `values`, or None, and the problems of both.

    With `defaults`, a file without any weight has the load of the paper's start, on B-splines as near as they come to
    it.
    """
    known = (*MODEL_KEYS, *_LOAD_KEYS)
    problems = unknown_names(model, known, "entry of [model]")
    basis = model.get("load_basis", "paper")
    if basis not in BASES:
        return None, [*problems, unknown_name(str(basis), BASES, "load basis")]
    begins = defaults and basis == "b-spline" and not any(name.startswith("theta_") for name in values)
    if begins:
        model = {"knots": list(DEFAULT_KNOTS), **model}
    numbers, lacking = _paper_numbers(model, values) if basis == "paper" else _spline_numbers(model, values, begins)
    problems += lacking
    for name, value in numbers.items():
        if not isinstance(value, list) or not all(is_number(v) for v in value):
            problems.append(f"{name} = {value!r}: numbers are needed.")
    if problems:
        return None, problems
    try:
        theta, knots = tuple(numbers["theta"]), tuple(numbers["knots"])
        if begins:
            return Load.on_b_splines(knots=knots), []
        return Load(theta, knots, float(numbers["phi2_slope"][0]), basis), []
    except ParameterError as error:
        return None, str(error).splitlines()


def _paper_numbers(model: dict[str, Any], values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Weights, knots and slope of the paper's splines; missing ones are those of the paper."""
    default = Load()
    theta = [values.get(name, value) for name, value in zip(default.names, default.theta, strict=True)]
    knots, slope = model.get("knots", list(default.knots)), model.get("phi2_slope", default.phi2_slope)
    return {"knots": knots, "phi2_slope": [slope], "theta": theta}, []


def _spline_numbers(model: dict[str, Any], values: dict[str, Any], begins: bool) -> tuple[dict[str, Any], list[str]]:
    """Weights and knots of B-splines; all are required, unless a search `begins` without weights."""
    problems = []
    if "phi2_slope" in model:
        problems.append("[model] phi2_slope belongs to load_basis = 'paper'; take it out for 'b-spline'.")
    knots = model.get("knots")
    if not isinstance(knots, list):
        problems.append("[model] knots: load_basis = 'b-spline' needs a list of two or more positions in m.")
        return {}, problems
    if len(knots) > MOST_KNOTS:
        problems.append(f"[model] knots: {len(knots):,} positions; at most {MOST_KNOTS} are allowed.")
        return {}, problems
    names = [f"theta_{i + 1}" for i in range(len(knots) + 2)]
    missing = [name for name in names if name not in values]
    if missing and not begins:
        shown = ", ".join(missing[:5]) + (", ..." if len(missing) > 5 else "")
        problems.append(
            f"[parameters] {shown}: missing; {len(knots)} knots of load_basis = 'b-spline' need the "
            f"{len(names)} weights {names[0]} to {names[-1]} in N."
        )
    theta = [values[name] for name in names if name in values]
    return {"knots": knots, "phi2_slope": [Load().phi2_slope], "theta": theta}, problems
