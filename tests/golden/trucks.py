"""Golden trucks: types, changes, loads and recordings of both families, new and worn, as hashes and some samples."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck import CHANGES, MANOEUVRES, Drive, Vehicle, aged, changed, drive, load_curve, respond, truck

#: Types by family: every valve, drive, friction, load and way of holding the duty cycles is among them.
NUMBERS = {"A": (*range(13), 1003), "B": (*range(16), 1003)}

#: Options of a drive that the types take in turn.
OPTIONS: tuple[Mapping[str, Any], ...] = (
    {},
    {"recorder": "bus", "dropouts": 2},
    {"conditions": True},
    {"stuck": (1.0, 1.2)},
    {"wear": 1.2e-3, "cycles": 4e5},
    {"wear": 2.5e-3, "cycles": 9e5, "zero": "kept"},
    {"offset": 2e-4, "late": 2e-3},
    {"supply": 7.6e5, "pressure": False},
)


def hash_of(kind: Vehicle) -> str:
    """Hash of every parameter of a truck, those that name a variant too, in the order of their names."""
    known = {name: getattr(kind, name) for name in (*type(kind).names(), "load", "drive", "valve", "spool", "duty")
             if hasattr(kind, name)}  # fmt: skip
    known |= {"friction": kind.friction} if hasattr(kind, "friction") else {}
    bits = [f"{name} {value if isinstance(value, str) else float(value).hex()}" for name, value in known.items()]
    return hashlib.sha256("\n".join(sorted(bits)).encode()).hexdigest()[:16]


def hashed(*columns: FloatArray) -> str:
    """Hash of all bits of arrays."""
    bits = b"".join(np.ascontiguousarray(values, dtype=np.float64).tobytes() for values in columns)
    return hashlib.sha256(bits).hexdigest()[:16]


def of_drive(done: Drive) -> dict[str, Any]:
    """Hashes of every column of a recording and of its truth, and some samples of the position."""
    columns = {"time": done.log.time, **done.log.columns, "wanted": done.wanted}
    truth = {"zero": done.truth.zero, "shift": done.truth.shift, "touch": done.truth.touch}
    return {
        "log": {name: hashed(values) for name, values in columns.items()},
        "truth": hashed(*(values for _, values in sorted(done.truth.states.items()))),
        "at": {name: float(value).hex() for name, value in truth.items()},
        "samples": done.log["position"][::499].tolist(),
    }


def of_load(kind: Vehicle) -> str:
    """Hash of the table of a load."""
    curve = load_curve(kind)
    return hashed(curve.breakpoints, curve.coefficients)


def recordings(family: str, number: int) -> Iterator[tuple[str, Drive]]:
    """Short drives of a type: one of each manoeuvre in turn, changes and temperatures in turn, a response."""
    kind, names = truck(number, family), list(MANOEUVRES)
    options = OPTIONS[number % len(OPTIONS)]
    manoeuvre = names[number % len(names)]
    yield "plain", drive(kind, seconds=3.0, seed=number, manoeuvre=manoeuvre, **options)
    yield "worn", drive(kind, seconds=3.0, seed=100 + number, wear=1.5e-3, cycles=4.5e5, manoeuvre="strokes")
    for i, change in enumerate(CHANGES):
        if (number + i) % 3 == 0:
            yield change, drive(kind, seconds=2.5, seed=7 * number + i, change=change, conditions=True)
    both = ("supply", "warm") if number % 2 else ("cold", "valves", "seals")
    yield "+".join(both), drive(kind, seconds=2.5, seed=200 + number, change=both, wear=1e-3, cycles=3e5)
    yield "cool", drive(kind, seconds=2.0, seed=300 + number, temperature=kind.T_0 - 10.0, manoeuvre="ramps")
    t = np.arange(2500)
    supply, exhaust = np.clip(0.6 * np.sin(t / 200), 0, 1), np.clip(-0.7 * np.sin(t / 200), 0, 1)
    yield "response", respond(kind, supply, exhaust)


def trucks() -> dict[str, Any]:
    """Types, all of their changes, their loads and recordings; of two of each family half a minute."""
    found: dict[str, Any] = {}
    for family, numbers in NUMBERS.items():
        for number in numbers:
            kind = truck(number, family)
            old = aged(kind, 2e-3, 6e5)
            found[f"{family}{number}"] = {
                "type": hash_of(kind),
                "changes": {change: hash_of(changed(kind, change)) for change in CHANGES},
                "loads": {"new": of_load(kind), "worn": of_load(old)},
                "recordings": {name: of_drive(done) for name, done in recordings(family, number)},
            }
        for number in (1, 5):
            done = drive(number, family=family, seconds=30.0, seed=number)
            found[f"{family}{number}"]["recordings"]["half a minute"] = of_drive(done)
    return found
