"""An observer in C99: model, filter, data and runtime, a header and a source each."""

from __future__ import annotations

import re
import shutil
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from clutchid.codegen.c99 import CSource, c99_source, comment
from clutchid.codegen.kernel_c99 import CNames, kernel_c99, record_c99, values_c99
from clutchid.codegen.language import C_WORDS
from clutchid.codegen.templates import template
from clutchid.errors import ParameterError
from clutchid.estimation.assess import comparison, observed
from clutchid.exports.data import carrier_us, data_of, provenance, size_of
from clutchid.exports.filter import correction_shares, filter_c99
from clutchid.exports.outputs import REASONS
from clutchid.inference.uncertainty import conditions
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels, system
from clutchid.numerics.interval import QUANTILE
from clutchid.observer import (
    by_stroke,
    contradiction,
    faults_rule,
    flags,
    intake,
    intake_rule,
    mismatch,
    mismatch_rule,
    rest,
    rest_rule,
)
from clutchid.observer.configuration import LEAK_FOUND, Observer
from clutchid.observer.following import BEYOND_STOPS, HELD_BACK
from clutchid.observer.inputs import SHORT, no_inputs, rules, window_size
from clutchid.observer.state import AS_CALIBRATED, FROZEN, NO_FAULTS, ObserverState
from clutchid.simulation import plan
from clutchid.strokes import excitation, plausible, rest_shift_rule, rule, stroke, stroke_rule

Real = Literal["float", "double"]
Rates = Literal["one", "two"]

#: Modules whose kernels are printed, in the order of their calls; those that the templates call; records of the state
#: of an observer, and of its data.
_KERNELS = (
    plausible, stroke_rule, rest_shift_rule, rest_rule, intake_rule, contradiction, faults_rule, mismatch_rule,
)  # fmt: skip
_CALLED = (
    "take_in", "excess_after", "gain_of", "fade", "recent", "note_faults", "end_of_stroke", "normalised_square",
    "count_innovation",
)  # fmt: skip
_STATES = (rule.Watch, stroke.Stroke, rest.Rest, intake.Intake, intake.Sample, flags.Faults, mismatch.Mismatch)
_DATA = (intake.IntakeLimits, rule.ValueLimits, rest.RestBefore)

#: Modules whose constants the templates take, by name.
_CONSTANTS = SimpleNamespace(**{
    module.__name__.rpartition(".")[2]: module
    for module in (
        by_stroke, comparison, conditions, contradiction, excitation, mismatch, observed, plan, rest, stroke,
    )
})  # fmt: skip

#: Mean openings of the valves over a step, with their duty cycles in this period of the carrier and in the last one. A
#: valve without a pulse in either is closed: rounding would leave the sum of its pulses above 0.
_OPENINGS = {"y_vs": ("supply", "supply_before"), "y_ve": ("exhaust", "exhaust_before")}


@dataclass(frozen=True, slots=True)
class CStyle:
    """Names, type of numbers and tasks of an observer in C.

    Parameters
    ----------
    name
        Prefix of every name, a C identifier.
    real
        'float' or 'double', the type of every number.
    rates
        'one' task, or 'two' with corrections in the slower one.
    """

    name: str = "clutch"
    real: Real = "float"
    rates: Rates = "one"

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,30}", self.name) or self.name in C_WORDS:
            raise ParameterError(
                f"--name {self.name!r}: not a C identifier; letters, digits and underscores are allowed, at most 31, "
                "and the first is a letter."
            )

    @property
    def values(self) -> dict[str, Any]:
        """Values for templates, with the printer of its numbers."""
        return {"name": self.name, "real": self.real, "two": self.rates == "two", "number": c_number(self.real)}


def c_number(real: Real) -> Callable[[Any], str]:
    """The printer of numbers as literals of a type."""

    def printed(value: Any) -> str:
        number = float(value)
        if not np.isfinite(number):
            infinity = "HUGE_VAL" if real == "double" else "HUGE_VALF"
            return f"({real})NAN" if np.isnan(number) else f"-{infinity}" if number < 0.0 else infinity
        text = repr(number) if real == "double" else f"{np.float32(number):.9g}"
        text = text if any(mark in text for mark in ".e") else f"{text}.0"
        return text if real == "double" else f"{text}F"

    return printed


def state_notes(actuator: Actuator) -> dict[str, str]:
    """Comments on the states in C: their meaning and unit."""
    return {name: f"{row.meaning}, in {row.unit}" for name, row in actuator.state_rows.items()}


def source_files(modules: Mapping[str, CSource]) -> dict[str, str]:
    """Headers and sources of modules in C by their file name."""
    headers = {f"{stem}.h": code.header for stem, code in modules.items()}
    return headers | {f"{stem}.c": code.source for stem, code in modules.items()}


def compiler() -> str | None:
    """The C compiler of this machine; None without one."""
    return shutil.which("cc") or shutil.which("gcc")


def observer_c99(observer: Observer, state: ObserverState, style: CStyle, title: str) -> dict[str, CSource]:
    """The modules of an observer in C by their file stem, in the order in which they include each other.

    Parameters
    ----------
    state
        What is known of the parameters that adapt at the start.
    title
        What it was made from, for the comment at the head.
    """
    joint, actuator = observer.joint, observer.joint.mapped.actuator
    data = data_of(observer, state)
    derivatives = [c.base for c in joint.coordinates[: joint.moving.of_model.size]]
    model = replace(system(actuator.model), name=f"{style.name}_model")
    names = CNames(style.real, c_number(style.real), "rule_", style.name)
    window, fresh, expected = window_size(observer.spacing), no_inputs(observer.spacing), rules(observer)
    entries = {
        **data,
        **_times(observer),
        **style.values,
        "title": comment(title),
        "size": size_of(joint),
        "provenance": provenance(observer),
        "crc_table": [_crc_of_nibble(nibble) for nibble in range(16)],
        "of": _CONSTANTS,
        "reasons": REASONS,
        "supply": "pressure_supply" in joint.measure,
        "inputs": _inputs(observer),
        "carrier": carrier_us(actuator) > 0 and "c_pwm" in kernels(actuator.model).INPUTS,
        "bins": window.bin,
        "bins_in_window": window.bins,
        "quantile": QUANTILE,
        "leak_found": LEAK_FOUND,
        "frozen": FROZEN,
        "rules": kernel_c99(_KERNELS, _CALLED, names),
        "states_of_rules": "\n".join(record_c99(record, names) for record in _STATES),
        "records_of_rules": "\n".join(record_c99(record, names) for record in _DATA),
        "no_intake": values_c99(fresh.intake, names),
        "no_watch": values_c99(fresh.watch, names),
        "no_faults": values_c99(NO_FAULTS, names),
        "no_mismatch": values_c99(AS_CALIBRATED, names),
        "fades": flags.FADES,
        "intake_limits": values_c99(expected.limits, names),
        "value_limits": values_c99(expected.bounds, names),
        "rest": values_c99(expected.before, names),
        "correction_s": joint.settings.every * joint.settings.spacing,
        "beyond_stops": BEYOND_STOPS,
        "held_us": round(HELD_BACK / stroke.RESOLUTION),
        "rounded_down": 1.0 - 1e-9,
        "every": joint.settings.every,
        "shares": correction_shares(size_of(joint), joint.settings.every),
    }
    places = entries["inputs"]
    idle = {name: [places[duty] for duty in duties] for name, duties in _OPENINGS.items() if entries["carrier"]}
    equations = c99_source(model, real=style.real, notes=state_notes(actuator), derivatives=derivatives, idle=idle)
    modules = {
        f"{style.name}_model": equations,
        f"{style.name}_filter": filter_c99(size_of(joint), style.real, f"{style.name}_filter"),
    }
    entries["code"] = _code(modules, entries)
    modules |= {f"{style.name}_data": _both("data", entries), style.name: _both("observer", entries)}
    head = provenance(observer).head
    return {stem: replace(part, header=head + part.header) for stem, part in modules.items()}


def _code(modules: Mapping[str, CSource], entries: dict[str, Any]) -> int:
    """A number of 32 bits that calibrations share whose exports differ in nothing but the values of the data."""
    blank = {**entries, "code": 0, "title": ""}
    parts = [*modules.values(), _both("observer", blank)]
    texts = [_both("data", blank).header, *(part.header + part.source for part in parts)]
    return zlib.crc32("".join(texts).encode())


def _crc_of_nibble(nibble: int) -> int:
    """CRC-32 (0xEDB88320, reflected) of four bits."""
    for _ in range(4):
        nibble = nibble >> 1 ^ (0xEDB88320 if nibble & 1 else 0)
    return nibble


def _both(part: str, entries: dict[str, Any]) -> CSource:
    return CSource(*(template(f"{part}.{suffix}.j2", "clutchid.exports").render(entries) for suffix in "hc"))


def _times(observer: Observer) -> dict[str, Any]:
    period, spacing = carrier_us(observer.joint.mapped.actuator), round(observer.spacing * 1e6)
    return {
        "carrier_us": period,
        "period": observer.joint.mapped.actuator.parameters.T_pwm,
        "spacing_us": spacing,
        "shortest_us": round(SHORT * spacing),
        "bridged_us": intake.BRIDGED,
        "past": period // spacing + 3,
    }


def _inputs(observer: Observer) -> dict[str, int | None]:
    """Places of the inputs: duty cycles, then phase, step and the duty cycles a period before where there are any."""
    names = ("supply", "exhaust", "phase", "step", "supply_before", "exhaust_before")
    count = len(kernels(observer.joint.mapped.actuator.model).INPUTS)
    return {name: i if i < count else None for i, name in enumerate(names)}
