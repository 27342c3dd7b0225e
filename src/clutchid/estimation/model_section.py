"""Entries of ``[model]`` in a parameter file: name of the model, and duty cycles; a file never loads code."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from clutchid.model.compiled import Model
from clutchid.model.own import OwnModel
from clutchid.parameters import is_number

#: Entries that name the model, and those of the duty cycles.
MODEL_KEYS = ("variant", "own", "sha256", "duty", "duty_period")


def model_entries(model: Model) -> dict[str, str]:
    """Entries of a model: a variant, or one of the user's own by file and name, with its hash."""
    if not isinstance(model, OwnModel):
        return {"variant": model}
    return {"variant": model.base, "own": str(model), "sha256": model.sha256}


def model_in(section: Mapping[str, Any], given: OwnModel | None) -> tuple[Model, list[str]]:
    """The model of a file, which is the `given` one if the file was saved with it, and problems.

    A file without any of these entries has values for every model.
    """
    if given is not None:
        return given, _mismatch(section, given)
    saved, variant = section.get("own"), section.get("variant", "isothermal")
    if saved is not None:
        return "isothermal", [
            f"[model] own = '{saved}': the file is for a model of your own, and a parameter file never loads code; "
            f"name the model too: --model {saved}, or read_parameters(path, own_model(FILE, NAME))."
        ]
    if not isinstance(variant, str):
        return "isothermal", [f"[model] variant = {variant!r}: a name in quotes is needed, for example 'isothermal'."]
    return variant, []


def duty_entries(period: float | None) -> dict[str, str | float]:
    """Entries of the period in s at which a control unit renews the duty cycles; none if it is not known.

    Examples
    --------
    >>> duty_entries(None), duty_entries(0.0), duty_entries(0.01)
    ({}, {'duty': 'continuous'}, {'duty': 'latched', 'duty_period': 0.01})
    """
    if period is None:
        return {}
    return {"duty": "latched", "duty_period": period} if period > 0.0 else {"duty": "continuous"}


def duty_period_in(section: Mapping[str, Any]) -> tuple[float | None, list[str]]:
    """Period in s at which a control unit renews the duty cycles, None in a file that does not say, and problems."""
    duty, period = section.get("duty"), section.get("duty_period")
    known = float(period) if isinstance(period, (int, float)) and is_number(period) else math.nan
    if duty not in (None, "continuous", "latched"):
        return None, [f"[model] duty = {duty!r}: must be 'continuous' or 'latched'."]
    if duty != "latched" and period is not None:
        return None, [f"[model] duty_period = {period!r}: belongs to duty = 'latched'; take it out, or add that."]
    if duty != "latched":
        return (None if duty is None else 0.0), []
    if not 0.0 < known < math.inf:
        got = "missing" if period is None else repr(period)
        return None, [f"[model] duty_period: {got}; duty = 'latched' needs a period above 0 in s, for example 0.01."]
    return known, []


def _mismatch(section: Mapping[str, Any], given: OwnModel) -> list[str]:
    """Why a file is not one of the model `given`."""
    saved, sha256, variant = (section.get(key) for key in ("own", "sha256", "variant"))
    if saved is None and variant is not None:
        return [
            f"[model] variant = '{variant}': the file is for this variant, not for the model {given}; leave --model "
            "out, or take variant out of the file to start the model from its values."
        ]
    if saved is not None and sha256 is None:
        return [
            f"[model] sha256: missing; a file with own = '{saved}' needs the hash of its model. That of {given} is "
            f"'{given.sha256}'; write it if the values belong to this model."
        ]
    if saved is not None and sha256 != given.sha256:
        return [
            f"[model] sha256 = '{_short(sha256)}': {given} has '{_short(given.sha256)}'. It is another model than "
            f"'{saved}' was when this file was saved, or its equations, parameters or states have changed since; take "
            "that model, or calibrate again with this one."
        ]
    return []


def _short(sha256: object) -> str:
    text = str(sha256)
    return f"{text[:12]}..." if len(text) > 12 else text
