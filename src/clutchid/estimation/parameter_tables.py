"""An actuator and its recordings in a parameter file: all sections but ``[fit]``, written and read."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Literal, NamedTuple

from clutchid.arguments import is_number
from clutchid.errors import ParameterError
from clutchid.files.records import Rule, collected, read_record, table
from clutchid.messages import listed, shortened
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import Model
from clutchid.model.equipment import Equipment
from clutchid.model.own import OwnModel
from clutchid.model.weighted_load import DEFAULT_KNOTS, MOST_KNOTS, Load
from clutchid.names import unknown_names
from clutchid.parameters import Parameters
from clutchid.strokes.rest_shift import FURTHEST

#: The entry of ``[actuator]`` that is no field of `Equipment`: a constant load in N, against positive motion.
_GRAVITY = "gravity_load"

#: Entry with the length in m subtracted from the position of a recording because its vented rest had moved.
REST = "rest_shift"

Starts = tuple[tuple[float, float], ...]


class _ModelSection(NamedTuple):
    """Section ``[model]``; None where the file says nothing.

    A model of the user's own is saved by name and hash: a file never loads code. `duty` says whether a control unit
    renews the duty cycles every `duty_period` s.
    """

    variant: str | None = None
    own: str | None = None
    sha256: str | None = None
    duty: Literal["continuous", "latched"] | None = None
    duty_period: float | None = None
    load_basis: Literal["paper", "b-spline"] | None = None
    knots: tuple[float, ...] | None = None
    phi2_slope: float | None = None


class _Starts(NamedTuple):
    """Start values of the segments of a recording: positions in m and pressures in chamber A in Pa."""

    position_start: tuple[float, ...] = ()
    pressure_a_start: tuple[float, ...] = ()


_PERIOD = "duty = 'latched' needs a period above 0 in s, for example 0.01"
_RULES = {
    "variant": Rule("a name in quotes is needed, for example 'isothermal'"),
    "duty": Rule("must be 'continuous' or 'latched'"),
    "duty_period": Rule(_PERIOD),
    "knots": Rule("numbers are needed, two or more positions in m"),
    "phi2_slope": Rule("numbers are needed, 1 (stated conditions) or 0.001 (as published)"),
    "position_start": Rule(
        "a list of finite numbers is needed, one per segment", lambda starts: all(map(math.isfinite, starts))
    ),
    "pressure_a_start": Rule(
        "a list of finite numbers is needed, one per segment; pressures are absolute, in Pa, and above 0",
        lambda starts: all(0.0 < pressure < math.inf for pressure in starts),
    ),
    REST: Rule(
        f"a number in m is needed; a rest moves by at most {FURTHEST:g} m", lambda shift: abs(shift) <= FURTHEST
    ),
}


def actuator_tables(actuator: Actuator) -> dict[str, dict[str, Any]]:
    """The sections of an actuator; the paper's chambers and valves have none."""
    load, period = actuator.load, actuator.duty_period
    section = _ModelSection(
        **model_entries(actuator.model),
        duty=None if period is None else "latched" if period else "continuous",
        duty_period=period or None,
        load_basis="paper" if load.basis == "paper" else "b-spline",
        knots=load.knots,
        phi2_slope=load.phi2_slope if load.basis == "paper" else None,
    )
    names = [name for name in actuator.names if not actuator.equipment.missing(name)]
    equipment = {name: value for name, value in table(actuator.equipment).items() if value != ""}
    return {
        **({} if actuator.equipment == Equipment() else {"actuator": equipment}),
        "model": table(section),
        "parameters": {name: actuator.value(name) for name in names},
    }


def model_entries(model: Model) -> dict[str, Any]:
    """Entries of a model: a variant, or one of the user's own by file and name, with its hash."""
    if not isinstance(model, OwnModel):
        return {"variant": model}
    return {"variant": model.base, "own": str(model), "sha256": model.sha256}


def actuator_in(document: Mapping[str, Any], own_model: OwnModel | None, problems: list[str]) -> Actuator | None:
    """The actuator of a file, which has the `own_model` if the file was saved with it; None with any problem.

    Parameters
    ----------
    document
        The file; ``[actuator]``, ``[model]`` and ``[parameters]``, if present, are sections. Without entries of a
        model it has values for every model.
    problems
        What is unknown or inadmissible is added.

    Raises
    ------
    ParameterError
        If the file is for another model than `own_model`, which alone could say what is wrong with the rest.
    """
    before, values = len(problems), dict(document.get("parameters", {}))
    section = collected(problems, read_record, _ModelSection, document.get("model", {}), "[model]", _RULES)
    equipment = _equipment(document, problems)
    load, period = None, None
    if section is not None:
        _check_model(section, own_model)
        constant = document.get("actuator", {}).get(_GRAVITY)
        section, values = collected(problems, _with_gravity, section, values, constant) or (section, values)
        load = _load(section, values, "actuator" not in document, problems)
        period = _duty_period(section, problems)
    own = _own(values, own_model, problems)
    parameters = _parameters(values | equipment.fixed, load, tuple(own), problems)
    if len(problems) > before or section is None or load is None or parameters is None:
        return None
    model = own_model or section.variant or "isothermal"
    return collected(problems, Actuator, parameters, load, model, equipment, tuple(own.values()), period)


def _check_model(section: _ModelSection, own_model: OwnModel | None) -> None:
    """Refuse a file that is not one of the model `own_model`."""
    variant, saved, sha256 = section[:3]
    if own_model is None and saved is not None:
        raise ParameterError(
            f"[model] own = '{saved}': the file is for a model of your own, and a parameter file never loads code; "
            f"name the model too: --model {saved}, or read_parameters(path, own_model(FILE, NAME))."
        )
    if own_model is not None and saved is None and variant is not None:
        raise ParameterError(
            f"[model] variant = '{variant}': the file is for this variant, not for the model {own_model}; leave "
            "--model out, or take variant out of the file to start the model from its values."
        )
    if own_model is not None and saved is not None and sha256 is None:
        raise ParameterError(
            f"[model] sha256: missing; a file with own = '{saved}' needs the hash of its model. That of {own_model} is "
            f"'{own_model.sha256}'; write it if the values belong to this model."
        )
    if own_model is not None and saved is not None and sha256 not in (None, own_model.sha256):
        raise ParameterError(
            f"[model] sha256 = '{shortened(str(sha256), 13)}': {own_model} has '{shortened(own_model.sha256, 13)}'. It "
            f"is another model than '{saved}' was when this file was saved, or its equations, parameters or states "
            "have changed since; take that model, or calibrate again with this one."
        )


def _duty_period(section: _ModelSection, problems: list[str]) -> float | None:
    """Period in s at which a control unit renews the duty cycles, None in a file that does not say."""
    duty, period = section.duty, section.duty_period
    if duty != "latched":
        if period is not None:
            problems.append(f"[model] duty_period = {period!r}: belongs to duty = 'latched'; take it out, or add that.")
        return None if duty is None else 0.0
    if period is None or not 0.0 < period < math.inf:
        got = "missing" if period is None else repr(period)
        problems.append(f"[model] duty_period: {got}; {_PERIOD}.")
    return period


def _equipment(document: Mapping[str, Any], problems: list[str]) -> Equipment:
    """Chambers and valves; those of the paper with any problem."""
    if "actuator" not in document:
        return Equipment()
    section, values = document["actuator"], document.get("parameters", {})
    names = [item.name for item in fields(Equipment)]
    problems += unknown_names(section, (*names, _GRAVITY), "entry of [actuator]")
    values_of = {name: section[name] for name in names if name in section}
    equipment = collected(problems, lambda: Equipment(**values_of))
    if equipment is None:
        return Equipment()
    drawn = [name for name, row in Parameters.rows().items() if row.drawing and not equipment.missing(name)]
    if lacking := [name for name in drawn if name not in values]:
        problems.append(
            f"[parameters] {', '.join(lacking)}: missing; a file with [actuator] needs the values of its drawing, "
            "because the defaults are those of another actuator."
        )
    problems += [sentence for name in values if (sentence := equipment.missing(name))]
    return equipment


def _with_gravity(section: _ModelSection, values: dict[str, Any], load: Any) -> tuple[_ModelSection, dict[str, Any]]:
    """``[model]`` and ``[parameters]`` with the constant `load` in N, where there is one."""
    if load is None:
        return section, values
    where = f"[actuator] {_GRAVITY} = {load!r}"
    if not is_number(load) or not math.isfinite(load):
        raise ParameterError(f"{where}: a finite force in N against positive motion is needed, M g for a lifted mass.")
    weights = [name for name in values if name.startswith("theta_")]
    if weights or section.load_basis == "paper":
        other = weights[0] if weights else "load_basis = 'paper'"
        raise ParameterError(f"{where}: it defines the whole load, and so does {other}; leave one of them out.")
    stroke = values.get("y_max", 0.0)
    knots = (0.0, float(stroke) if is_number(stroke) else 0.0) if section.knots is None else section.knots
    constant = {f"theta_{i + 1}": float(load) for i in range(len(knots) + 2)}
    return section._replace(load_basis="b-spline", knots=knots), {**values, **constant}


def _load(section: _ModelSection, values: dict[str, Any], defaults: bool, problems: list[str]) -> Load | None:
    """The load: basis and knots of ``[model]``, weights among the parameters; None with any problem.

    With `defaults`, a file without any weight has the load of the paper's start, on B-splines as near as they come to
    it.
    """
    paper, before = Load(), len(problems)
    if section.load_basis != "b-spline":
        knots = paper.knots if section.knots is None else section.knots
        slope = paper.phi2_slope if section.phi2_slope is None else section.phi2_slope
        theta = [values.get(name, value) for name, value in zip(paper.names, paper.theta, strict=True)]
        return _weighted(theta, knots, slope, "paper", problems)
    if section.phi2_slope is not None:
        problems.append("[model] phi2_slope belongs to load_basis = 'paper'; take it out for 'b-spline'.")
    begins = defaults and not any(name.startswith("theta_") for name in values)
    knots = section.knots or (DEFAULT_KNOTS if begins and section.knots is None else ())
    names = [f"theta_{i + 1}" for i in range(len(knots) + 2)]
    missing = [] if begins else [name for name in names if name not in values]
    if not knots:
        problems.append("[model] knots: load_basis = 'b-spline' needs a list of two or more positions in m.")
    elif len(knots) > MOST_KNOTS:
        problems.append(f"[model] knots: {len(knots):,} positions; at most {MOST_KNOTS} are allowed.")
    elif missing:
        problems.append(
            f"[parameters] {listed(missing)}: missing; {len(knots)} knots of load_basis = 'b-spline' need the "
            f"{len(names)} weights {names[0]} to {names[-1]} in N."
        )
    if len(problems) > before:
        return None
    if begins:
        return collected(problems, Load.on_b_splines, None, knots)
    return _weighted([values[name] for name in names], knots, paper.phi2_slope, "b-spline", problems)


def _weighted(theta: list[Any], knots: tuple[float, ...], slope: float, basis: str, problems: list[str]) -> Load | None:
    if not all(map(is_number, theta)):
        problems.append(f"theta = {theta!r}: numbers are needed.")
        return None
    return collected(problems, Load, tuple(theta), knots, slope, basis)


def _own(values: dict[str, Any], model: OwnModel | None, problems: list[str]) -> dict[str, float]:
    """Values of the parameters of a model of the user's own."""
    rows = {} if model is None else model.parameters
    own = {name: values.get(name, row.default) for name, row in rows.items()}
    wrong = [name for name, value in own.items() if not is_number(value)]
    problems += [f"{name} = {own[name]!r}: a number in {rows[name].unit} is needed." for name in wrong]
    return own


def _parameters(
    values: dict[str, Any], load: Load | None, own: tuple[str, ...], problems: list[str]
) -> Parameters | None:
    admissible = (*Parameters.names(), *own, *(load or Load()).names)
    # if the load itself is wrong, the number of its weights is unknown
    names = [name for name in values if load is not None or not re.fullmatch(r"theta_[1-9]\d*", name)]
    problems += unknown_names(names, admissible)
    of_parameters = {name: value for name, value in values.items() if name in Parameters.names()}
    return collected(problems, Parameters().replace, of_parameters)


def recording_tables(starts: Mapping[str, Starts], own: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, Any]]:
    """Sections ``[recording.'STEM']``: start values of the segments, and values of one recording."""
    return {
        stem: {
            "position_start": [position for position, _ in segments],
            "pressure_a_start": [pressure for _, pressure in segments],
            **own.get(stem, {}),
        }
        for stem, segments in starts.items()
    }


def recordings_in(
    recordings: Mapping[str, Any], model: OwnModel | None, problems: list[str]
) -> tuple[dict[str, Starts], dict[str, dict[str, float]]]:
    """Start values of the segments of every recording, and values of single recordings; problems are added."""
    names = (*Parameters.names(), *(model.parameters if model else ()), REST)
    read_recordings = {stem: collected(problems, _recording, stem, entry, names) for stem, entry in recordings.items()}
    starts = {stem: tables[0] for stem, tables in read_recordings.items() if tables}
    return starts, {stem: tables[1] for stem, tables in read_recordings.items() if tables and tables[1]}


def _recording(stem: str, entry: Any, names: Sequence[str]) -> tuple[Starts, dict[str, float]]:
    """Start values of the segments, and values of the parameters `names`, of one recording."""
    keys, where = _Starts._fields, f"[recording.'{stem}']"
    in_words = " and ".join(keys)
    if not isinstance(entry, dict):
        raise ParameterError(f"[recording] {stem} = {entry!r}: a section {where} with {in_words} is needed.")
    problems = unknown_names(entry, (*keys, *names), f"entry of {where}")
    lists = {key: value for key, value in entry.items() if key in keys}
    single = {name: value for name, value in entry.items() if name in names}
    starts = collected(problems, read_record, _Starts, lists, where, _RULES)
    own = collected(problems, read_record, dict[str, float], single, where, _RULES)
    if starts is not None and len({*map(len, starts)}) > 1:
        counts = " and ".join(str(len(column)) for column in starts)
        problems.append(f"{where}: {in_words} must have the same length; they have {counts} entries.")
    if problems or starts is None or own is None:
        raise ParameterError("\n".join(problems))
    return tuple(zip(*starts, strict=True)), own
