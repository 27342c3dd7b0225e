"""ASAP2 of an exported observer: what a tool measures and calibrates on the control unit, as a file ``NAME.a2l``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle
from clutchid.exports.data import provenance
from clutchid.exports.outputs import OUTPUTS, REASONS
from clutchid.inference.filter.joint_filter import JointFilter
from clutchid.inference.filter.setup import PARAMETER, WEIGHT
from clutchid.log.states import SENSOR_PARAMETERS, SENSORS
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import FLAGS

#: Limits of what has none: FLOAT32 holds them in every unit.
_UNLIMITED = 1e30

#: Numbers of an unsigned integer of 32 bits.
_UNSIGNED = (0.0, 2.0**32 - 1.0)


class Unit(NamedTuple):
    """Unit that a tool shows: name of its COMPU_METHOD, text, and factor from SI."""

    name: str
    shown: str
    factor: float = 1.0


class MemoryItem(NamedTuple):
    """A quantity in the memory of a control unit.

    `symbol` is a C expression without the prefix of the export; `low` and `high` are limits as shown; `size` counts the
    elements of an array; `mask` has the bit of a flag.
    """

    name: str
    symbol: str
    meaning: str
    unit: Unit
    low: float
    high: float
    type: str
    size: int = 1
    mask: str = ""


_COUNT, _FLAG, _TRUST = Unit("count", ""), Unit("flag", ""), Unit("trust", "")

#: Units by their text in SI, in ASCII. Another one is shown as it is.
_UNITS = {
    "1": Unit("ratio", ""),
    "m": Unit("mm", "mm", 1e3),
    "m/s": Unit("mm_s", "mm/s", 1e3),
    "m^2": Unit("cm2", "cm^2", 1e4),
    "m^3": Unit("cm3", "cm^3", 1e6),
    "s": Unit("ms", "ms", 1e3),
    "Pa": Unit("kPa", "kPa", 1e-3),
    "m^3/(Pa*s)": Unit("dm3_s_bar", "dm^3/(s*bar)", 1e8),
}


def a2l(observer: Observer, style: CStyle, title: str) -> str:
    """ASAP2 1.61 of an observer in C, in ASCII, with addresses of 0 and symbols that a tool finds in an ELF file.

    Measured are the variables ``NAME_observer``, ``NAME_output``, ``NAME_load_force``, ``NAME_load_low`` and
    ``NAME_load_high`` of the application. Calibrated are the means of the parameters and load weights that adapt, and
    the values of the other parameters that act, in ``NAME_data``. A parameter that adapts is measured as it was after
    one of the last two corrections.

    Parameters
    ----------
    title
        What the observer was made from.
    """
    joint, real = observer.joint, {"float": "FLOAT32_IEEE", "double": "FLOAT64_IEEE"}[style.real]
    measured = [*_outputs(observer, real), *_flags(), *_adapted(joint, real)]
    values = [*_free(joint, real), *_fixed(joint, real)]
    axis, *curves = _curves(observer, real)
    units = dict.fromkeys(item.unit for item in (*measured, *values, axis, *curves))
    text = template("asap2.a2l.j2", "clutchid.exports").render(
        name=style.name,
        title=" ".join(title.split()),
        real=style.real,
        type=real,
        number=lambda value: f"{value:.10g}",
        provenance=provenance(observer),
        measurements=measured,
        values=values,
        axis=axis,
        curves=curves,
        units=[unit for unit in units if unit not in (_COUNT, _FLAG, _TRUST)],
    )
    return _ascii(text)


def _ascii(text: str) -> str:
    return text.translate({ord("²"): "^2", ord("³"): "^3", ord("·"): "*"}).encode("ascii", "replace").decode()


def unit_of(si: str) -> Unit:
    """Unit that a tool shows for one in SI."""
    shown = _ascii(si)
    name = re.sub(r"\W", "_", shown.replace("^", "").replace("/", "_per_").replace("-", "minus"))
    return _UNITS.get(shown, Unit(f"si_{name}", shown))


def _item(
    name: str, symbol: str, meaning: str, si: str, limits: Sequence[float], real: str, size: int = 1
) -> MemoryItem:
    """A quantity with limits in SI."""
    unit = unit_of(si)
    low, high = np.clip(np.array(limits) * unit.factor, -_UNLIMITED, _UNLIMITED).tolist()
    return MemoryItem(name, symbol, " ".join(meaning.split()), unit, low, high, real, size)


def _outputs(observer: Observer, real: str) -> Iterator[MemoryItem]:
    p = observer.actuator.parameters
    limits = {"Pa": (0.0, 2.0 * p.P_S), "m": (-2.0 * p.y_max, 2.0 * p.y_max), "m/s": (-10.0, 10.0), "1": (0.0, 1e6)}
    for field, output in OUTPUTS.items():
        if output.unit:
            yield _item(field, f"output.{field}", output.meaning, output.unit, limits[output.unit], real)
        else:
            unit, ends = (_TRUST, (0.0, 2.0)) if field == "trust" else (_COUNT, _UNSIGNED)
            yield MemoryItem(field, f"output.{field}", output.meaning, unit, *ends, "ULONG")


def _flags() -> Iterator[MemoryItem]:
    for bit, (flag, meaning) in enumerate(FLAGS.items()):
        yield MemoryItem(f"flag.{flag}", "output.flags", meaning, _FLAG, 0.0, 1.0, "ULONG", mask=f"0x{1 << bit:X}")
    for bit, (reason, meaning) in enumerate(REASONS.items()):
        yield MemoryItem(
            f"because.{reason}", "output.reasons", meaning, _FLAG, 0.0, 1.0, "ULONG", mask=f"0x{1 << bit:X}"
        )
    for bit, (flag, meaning) in enumerate(FLAGS.items()):
        yield MemoryItem(
            f"samples.{flag}",
            f"observer.health[{bit}]",
            (f"samples so far in which {meaning}"),
            _COUNT,
            *_UNSIGNED,
            "ULONG",
        )


def _adapted(joint: JointFilter, real: str) -> Iterator[MemoryItem]:
    """Parameters and load weights as they are known now."""
    actuator = joint.mapped.actuator
    for coordinate, place in zip(joint.coordinates, joint.free.places.tolist(), strict=True):
        if place[WEIGHT] < 0:
            row, at = actuator.row(coordinate.base), f"observer.derived[0].p[{place[PARAMETER]}]"
            meaning = f"{row.meaning}, current estimate"
            yield _item(f"adapted.{coordinate.base}", at, meaning, row.unit, (row.low, row.high), real)
    weights, meaning = len(actuator.load.names), "weights of the load, current estimates"
    limits, unit = _weight_limits(joint), actuator.load.unit
    yield _item("adapted.load_weights", "observer.derived[0].weights", meaning, unit, limits, real, weights)


def _weight_limits(joint: JointFilter) -> tuple[float, float]:
    largest = 10.0 * max(1.0, *np.abs(joint.mapped.actuator.load.theta).tolist())
    return -largest, largest


def _free(joint: JointFilter, real: str) -> Iterator[MemoryItem]:
    """Means of the parameters that adapt."""
    actuator = joint.mapped.actuator
    for j, coordinate in enumerate(joint.coordinates):
        name, at = coordinate.base, f"data.filter.parameters[{j}].mean"
        if name in actuator.load.names:
            unit, limits = actuator.load.unit, _weight_limits(joint)
            yield _item(f"load.{name}", at, "weight of the load, initial value", unit, limits, real)
        else:
            row = actuator.row(name)
            yield _item(name, at, f"{row.meaning}, initial value", row.unit, (row.low, row.high), real)


def _fixed(joint: JointFilter, real: str) -> Iterator[MemoryItem]:
    """Values of the parameters that act and do not adapt: of the equations, then of the sensors."""
    actuator, adapting = joint.mapped.actuator, {c.base for c in joint.coordinates}
    acting = actuator.acting - adapting
    at = {name: f"p[{i}]" for i, name in enumerate(actuator.parameter_names) if name not in SENSOR_PARAMETERS}
    at |= {SENSORS[name].lag: f"lags[{m}]" for m, name in enumerate(joint.measure)}
    at |= {SENSORS[name].offset: f"offsets[{m}]" for m, name in enumerate(joint.measure)}
    for name in (name for name in at if name in acting):
        row = actuator.row(name)
        yield _item(name, f"data.derived.{at[name]}", row.meaning, row.unit, (row.low, row.high), real)


def _curves(observer: Observer, real: str) -> Iterator[MemoryItem]:
    """The axis of the load, then the load and its 95 % interval over it."""
    load = observer.joint.mapped.actuator.load
    positions = load.breakpoints
    peak = float(np.abs(load.force(positions)).max())
    ends = (float(positions[0]), float(positions[-1]))
    yield _item("load_position", "breakpoints", "positions of the load curve", "m", ends, real, positions.size)
    for part, meaning in (
        ("force", "load on the piston"),
        ("low", "lower end of the 95 % interval of the load"),
        ("high", "upper end of the 95 % interval of the load"),
    ):
        yield _item(f"load_{part}", f"load_{part}", meaning, "N", (-3.0 * peak, 3.0 * peak), real, positions.size)
