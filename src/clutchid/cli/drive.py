"""``clutchid drive``: a virtual truck on the road."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from clutchid.cli.common import DONE, EMPTY, guarded, print_json
from clutchid.errors import ParameterError


def drive(
    *,
    out: Path,
    truck: int = 0,
    seed: int = 0,
    seconds: float = 30.0,
    wear: float = 0.0,
    cycles: float = 0.0,
    temperature: float | None = None,
    manoeuvre: str = "mix",
    truth: Path | None = None,
    pressure: bool = True,
    bus: Annotated[bool, Parameter(negative="")] = False,
    dropouts: int = 0,
    json: Annotated[bool, Parameter(negative="")] = False,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Drive a virtual truck whose physics is richer than the model, and write the recording and, apart, the truth.

    Parameters
    ----------
    out
        Recording to write, .csv or .parquet.
    truck
        Number of the truck type; the same number is always the same truck.
    seed
        For everything random in the drive: manoeuvre, noise, air supply.
    seconds
        Length of the recording.
    wear
        Wear of the facing in mm.
    cycles
        Strokes that the clutch has done.
    temperature
        Ambient temperature in °C, in place of the truck's own.
    manoeuvre
        mix, gear-shift, pull-away, creep, staircase, strokes, ramps or validation.
    truth
        True load over the position, to write as JSON.
    pressure
        Record the pressure in the chamber too.
    bus
        Record on the bus, 100 Hz with its own clock, instead of 1 kHz in the controller.
    dropouts
        Number of stretches of 5 to 60 ms without measurements.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """

    def work() -> int:
        from clutchid import truck as virtual
        from clutchid.io import write

        _check(out, truth)
        done = virtual.drive(
            virtual.truck(truck), manoeuvre=manoeuvre, seconds=seconds, seed=seed, wear=wear * 1e-3, cycles=cycles,
            temperature=None if temperature is None else temperature + 273.15, pressure=pressure,
            recorder="bus" if bus else "controller", dropouts=dropouts, name=out.stem,
        )  # fmt: skip
        write(done.log, out)
        if truth is not None:
            done.write_truth(truth)
        written = [str(path.resolve()) for path in (out, truth) if path is not None]
        if json:
            print_json({**EMPTY, "status": "ok", "message": f"truck {truck} driven", "written": written})
        else:
            print("\n".join(f"written: {path}" for path in written))
        return DONE

    return guarded(work, as_json=json, debug=debug)


def _check(out: Path, truth: Path | None) -> None:
    """Make sure, before the drive, that recording and truth can be written."""
    from clutchid.io.files import check_writable

    check_writable(out)
    if truth is not None:
        check_writable(truth)
        if truth.resolve() == out.resolve():
            raise ParameterError(f"--truth {truth}: is the recording itself; name another file.")
