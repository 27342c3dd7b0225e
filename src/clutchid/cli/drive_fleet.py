"""``clutchid drive --fleet``: record many virtual vehicles in service."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

from clutchid.cli.progress import progress_of
from clutchid.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Service:
    """Options of a fleet.

    Parameters
    ----------
    fleet
        Number of vehicles; 0 for a single recording.
    months
        Time in service of a fleet.
    types
        Number of truck types in a fleet; the vehicles take them in turn.
    days
        Mean time from a recording of a vehicle to the next.
    workers
        Number of processes for a fleet; does not affect the results.
    """

    fleet: int = 0
    months: float = 12.0
    types: int = 4
    days: float = 7.0
    workers: int = 1


#: No fleet.
SINGLE = Service()


class Types(NamedTuple):
    """Family and first number of the truck types, and the seed of what happens to the vehicles."""

    family: str
    first: int
    seed: int


class Alone(NamedTuple):
    """Options of a single recording, in SI, as of `clutchid.truck.drive`."""

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
    zero: Literal["learned", "kept"] = "learned"
    late: float = 0.0


def drive_fleet(service: Service, types: Types, out: Path, seconds: float, alone: Alone, truth: Path | None) -> None:
    """Drive and write a fleet, for which no option of a single recording may be given.

    Raises
    ------
    ExportError, ParameterError
        As `clutchid.fleets.virtual.write_fleet`.
    """
    from clutchid.fleets.virtual import write_fleet
    from clutchid.truck.service import visits

    extra = [name for name, usual in Alone()._asdict().items() if getattr(alone, name) != usual]
    if extra or truth:
        option = {"pressure": "no-pressure", "recorder": "bus"}.get(extra[0], extra[0]) if extra else "truth"
        raise ParameterError(f"--{option}: belongs to a single recording; what happens to a fleet is drawn by --seed.")
    plan = visits(service.fleet, service.months, types.family, types.first, service.types, types.seed, service.days)
    with progress_of("drive") as progress:
        write_fleet(out, plan, seconds, service.workers, progress)
