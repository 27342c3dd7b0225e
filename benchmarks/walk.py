"""The way of the data through the house: ``python benchmarks/walk.py [--modules]``.

Five ways are followed while they run: of a recording through a calibration and through the reading of a load, of a file
through `read`, of a stream through ``clutchid observe -``, and of a recording as `track` reads it. A call counts that
hands on the data, or what holds them. Printed are the modules entered, climbs (calls from a room into a higher one) and
returns (entries into a room, a package of clutchid, that the data had left).
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import tomllib
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import fields, is_dataclass
from io import StringIO
from pathlib import Path
from types import FrameType
from typing import Any

import clutchid
from clutchid import Actuator, Log
from clutchid.cli import main as command
from clutchid.truck import drive, truck
from clutchid.verbs.reading import Reading
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.history import RecordingJob

os.environ["OMP_NUM_THREADS"] = "1"  # windows that other threads simulate are not seen here

ROOT = Path(__file__).resolve().parents[1]

#: How deep a value is looked into for the data.
DEPTH = 3


def floors() -> dict[str, int]:
    """Height of each room in the import contract, the ground at 0."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract = document["tool"]["importlinter"]["contracts"][0]
    rows = [[name.strip() for name in row.split("|")] for row in reversed(contract["layers"])]
    return {name.removeprefix("clutchid."): height for height, row in enumerate(rows) for name in row}


def carries(value: Any, kinds: tuple[type, ...], depth: int = DEPTH) -> bool:
    """Whether a value is the data, or holds them."""
    if isinstance(value, kinds):
        return True
    if depth == 0 or isinstance(value, (str, bytes, int, float, type)):
        return False
    if isinstance(value, Mapping):
        return any(carries(item, kinds, depth - 1) for item in list(value.values())[:8])
    if isinstance(value, (list, tuple)):
        return any(carries(item, kinds, depth - 1) for item in value[:8])
    if is_dataclass(value):
        return any(carries(getattr(value, field.name, None), kinds, depth - 1) for field in fields(value))
    return False


def way(work: Callable[[], object], kinds: tuple[type, ...]) -> list[tuple[str, str]]:
    """(caller, callee) modules of every call that hands the data on."""
    calls: list[tuple[str, str]] = []

    def note(frame: FrameType, event: str, _: Any) -> None:
        module = frame.f_globals.get("__name__", "")
        if event != "call" or not module.startswith("clutchid.") or "<" in frame.f_code.co_name:
            return
        names = frame.f_code.co_varnames[: frame.f_code.co_argcount + frame.f_code.co_kwonlyargcount]
        if module == "clutchid.log" or not any(carries(frame.f_locals.get(name), kinds) for name in names):
            return
        caller = frame.f_back
        while caller is not None and not str(caller.f_globals.get("__name__", "")).startswith("clutchid."):
            caller = caller.f_back
        origin = caller.f_globals["__name__"].removeprefix("clutchid.") if caller else "user"
        call = origin, module.removeprefix("clutchid.")
        if not calls or calls[-1] != call:
            calls.append(call)

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return calls


def room(module: str) -> str:
    """The package of clutchid that a module belongs to."""
    return module.partition(".")[0]


def described(title: str, calls: list[tuple[str, str]], height: Mapping[str, int], *, modules: bool) -> str:
    """The way in words; each pair of modules counts once."""
    distinct = list(dict.fromkeys(calls))
    pairs = [pair for pair in distinct if pair[0] != "user" and {room(pair[0]), room(pair[1])} <= set(height)]
    climbs = [pair for pair in pairs if height[room(pair[1])] > height[room(pair[0])]]
    sequence = [room(callee) for _, callee in distinct]
    entries = [entry for i, entry in enumerate(sequence) if i == 0 or sequence[i - 1] != entry]
    order = list(dict.fromkeys(callee for _, callee in distinct))
    returns = len(entries) - len(set(entries))
    lines = [f"{title}: {len(order)} modules in {len(set(entries))} rooms, {len(climbs)} climbs, {returns} returns"]
    lines += [f"  climbs: {origin} -> {module}" for origin, module in climbs]
    return "\n".join([*lines, *(f"  {number:2d}  {module}" for number, module in enumerate(order, 1) if modules)])


def observed(log: Log, calibration: Path, folder: Path) -> None:
    """Send a recording to ``clutchid observe -`` through a pipe."""
    path = folder / "stream.csv"
    clutchid.write(log, path)
    reader, writer = os.pipe()
    sender = threading.Thread(target=_send, args=(writer, path.read_bytes()))
    before = os.dup(0)
    os.dup2(reader, 0)
    sender.start()
    try:
        with redirect_stdout(StringIO()):
            command(["observe", "-", "--start", str(calibration), "--out", str(folder / "est.parquet"), "--json"])
    except SystemExit:
        pass
    finally:
        sender.join()
        os.dup2(before, 0)


def _send(writer: int, content: bytes) -> None:
    with os.fdopen(writer, "wb") as stream:
        stream.write(content)


def main() -> None:
    """Print the five ways."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--modules", action="store_true", help="list the modules too")
    options = parser.parse_args()
    height = floors()
    new, worn = drive(truck(0), seconds=8, seed=1, name="new").log, drive(truck(0), seconds=8, seed=2, wear=1e-3).log
    rich = Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines())
    both, few = ("position", "pressure_a"), ("load", "C_vs")
    calibrated = clutchid.fit(new, rich, measure=both, free=few, method="shooting")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording, calibration = folder / "worn.csv", folder / "cal.toml"
        clutchid.write(worn.without("pressure_a"), recording)
        clutchid.write_parameters(clutchid.parameter_file(calibrated), calibration)
        job = RecordingJob("worn", path=recording, start=calibration)
        ways: dict[str, tuple[Callable[[], object], tuple[type, ...]]] = {
            "calibration": (lambda: clutchid.fit(new, rich, measure=both, free=few, method="shooting"), (Log,)),
            "reading of a load": (
                lambda: clutchid.fit(
                    worn, calibrated.actuator, request=clutchid.FitRequest(calibration=calibrated.calibration)
                ),
                (Log,),
            ),
            "read": (lambda: clutchid.read(recording), (Path, Log)),
            "observe -": (lambda: observed(new.slice(0, 3000), calibration, folder), (Path, Log)),
            "a recording of track": (lambda: read_recording(Reading(), "fit", job), (Path, Log)),
        }
        for title, (work, kinds) in ways.items():
            print(described(title, way(work, kinds), height, modules=options.modules), flush=True)


if __name__ == "__main__":
    main()
