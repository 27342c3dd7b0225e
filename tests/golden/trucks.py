"""Golden trucks: types, changes, loads and recordings of both families, new and worn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy as np

from clutchid.truck import CHANGES, MANOEUVRES, Drive, Vehicle, aged, changed, load_curve, respond, truck
from clutchid.truck.load_table import LoadTable
from golden.comparison import some

#: Types by family: every valve, drive, friction, load and way of holding the duty cycles is among them.
NUMBERS = {"A": (*range(13), 1003), "B": (*range(16), 1003)}

#: Options of a drive that the types take in turn.
OPTIONS: tuple[Mapping[str, Any], ...] = (
    {},
    {"recorder": "bus", "dropouts": 2},
    {"conditions": True},
    {"stuck": (1.0, 1.2)},
    {"wear": 1.2e-3, "cycles": 4e5},
    {"wear": 2.5e-3, "cycles": 9e5, "sensor_zero": "kept"},
    {"offset": 2e-4, "late": 2e-3},
    {"supply": 7.6e5, "pressure": False},
)


class Driven(Protocol):
    """`clutchid.truck.drive` with a name, whose duty cycles are recorded or replayed."""

    def __call__(self, name: str, kind: Vehicle, **options: Any) -> Drive: ...


def parameters(kind: Vehicle) -> dict[str, float | str]:
    """Every parameter of a truck, those that name a variant too."""
    names = (*type(kind).names(), "load", "drive", "valve", "spool", "duty", "friction")
    values = {name: getattr(kind, name) for name in sorted(set(names)) if hasattr(kind, name)}
    return {name: value if isinstance(value, str) else float(value) for name, value in values.items()}


def other(kind: Vehicle, than: Vehicle) -> dict[str, float | str]:
    """The parameters of a truck that are not those of another one."""
    before = parameters(than)
    return {name: value for name, value in parameters(kind).items() if value != before.get(name)}


def of_load(curve: LoadTable) -> dict[str, Any]:
    """A load at every twentieth breakpoint, and the size of its coefficients."""
    at, size = curve.breakpoints[::20], np.sqrt(np.mean(curve.coefficients**2, axis=0))
    return {"rest": curve.rest, "touch": curve.touch, "force": curve.force(at).tolist(), "size": size.tolist()}


def of_drive(driven: Drive) -> dict[str, Any]:
    """Columns of a recording, and its true position without a sensor that rounds."""
    columns = {
        "time": driven.log.time,
        **driven.log.columns,
        "wanted": driven.wanted,
        "true": driven.truth.states["position"],
    }
    truth = {"zero": driven.truth.zero, "shift": driven.truth.shift, "touch": driven.truth.touch}
    return some(columns, 7) | truth


def of_response(driven: Drive) -> dict[str, Any]:
    """All true states, and the columns of sensors without noise."""
    truth = {f"true {name}": values for name, values in driven.truth.states.items()}
    return some({**truth, "position": driven.log["position"], "pressure_a": driven.log["pressure_a"]}, 4)


def recordings(family: str, number: int, drive: Driven) -> Iterator[tuple[str, Drive]]:
    """Short drives of a type: one of each manoeuvre in turn, changes and temperatures in turn."""
    kind, names = truck(number, family), list(MANOEUVRES)
    options, manoeuvre = OPTIONS[number % len(OPTIONS)], names[number % len(names)]
    yield "plain", drive(f"{family}{number} plain", kind, seconds=3.0, seed=number, manoeuvre=manoeuvre, **options)
    change = list(CHANGES)[number % len(CHANGES)]
    yield change, drive(
        f"{family}{number} {change}", kind, seconds=2.5, seed=100 + number, wear=1.5e-3, cycles=4.5e5, change=change,
        conditions=True, manoeuvre="strokes",
    )  # fmt: skip
    if number % 4 == 0:
        both = ("cold", "valves", "seals") if number % 8 else ("supply", "warm")
        yield "cool", drive(
            f"{family}{number} cool", kind, seconds=2.0, seed=300 + number, temperature=kind.T_0 - 10.0, change=both,
            manoeuvre="ramps",
        )  # fmt: skip


def response(kind: Vehicle) -> Drive:
    """Response to duty cycles that fill and vent the chamber."""
    t = np.arange(2500)
    return respond(kind, np.clip(0.6 * np.sin(t / 200), 0, 1), np.clip(-0.7 * np.sin(t / 200), 0, 1))


def trucks(drive: Driven) -> dict[str, Any]:
    """Types, all of their changes, their loads and recordings."""
    results: dict[str, Any] = {}
    for family, numbers in NUMBERS.items():
        for number in numbers:
            kind, first = truck(number, family), truck(numbers[0], family)
            results[f"{family}{number}"] = {
                "type": parameters(kind) if number == numbers[0] else other(kind, first),
                "changes": {change: other(changed(kind, change), kind) for change in CHANGES},
                "loads": {"new": of_load(load_curve(kind)), "worn": of_load(load_curve(aged(kind, 2e-3, 6e5)))},
                "response": of_response(response(kind)),
                **{name: of_drive(driven) for name, driven in recordings(family, number, drive)},
            }
    return results
