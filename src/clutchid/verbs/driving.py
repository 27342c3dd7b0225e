"""`drive`: a recording of a virtual truck as a file, with its truth."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

from clutchid.errors import ParameterError
from clutchid.files import check_writable
from clutchid.truck.service import FleetPlan, visits

__all__ = ["FleetPlan", "VirtualRecording", "driven", "visits"]


class VirtualRecording(NamedTuple):
    """A recording of a virtual truck, in SI, as `clutchid.truck.drive` makes it."""

    manoeuvre: str = "mix"
    wear: float = 0.0
    cycles: float = 0.0
    temperature: float | None = None
    pressure: bool = True
    recorder: Literal["controller", "bus"] = "controller"
    dropouts: int = 0
    conditions: bool = False
    change: tuple[str, ...] = ()
    supply: float | None = None
    offset: float = 0.0
    sensor_zero: Literal["learned", "kept"] | None = None
    late: float = 0.0


def driven(
    recording: VirtualRecording, number: int, family: str, seed: int, seconds: float, out: Path, truth: Path | None
) -> None:
    """Drive a truck of a family, and write the recording and, as JSON, its truth.

    Raises
    ------
    ExportError, ParameterError
        If the files cannot be written, or the truck cannot be driven so.
    """
    from clutchid import truck
    from clutchid.measurements import write

    check_writable(out)
    if truth is not None:
        check_writable(truth)
        if truth.resolve() == out.resolve():
            raise ParameterError(f"--truth {truth}: is the same file as --out; name another file.")
    drive = truck.drive(truck.truck(number, family), seconds=seconds, seed=seed, name=out.stem, **recording._asdict())
    write(drive.log, out)
    if truth is not None:
        drive.write_truth(truth)
