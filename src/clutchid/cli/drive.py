"""``clutchid drive``: record a virtual truck, or with ``--fleet`` many vehicles in service."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    FILES,
    FLEET,
    Flag,
    OutOption,
    OutputFlag,
    PathOutput,
    guarded,
    print_json,
    print_written,
    progress_of,
)
from clutchid.errors import ParameterError

if TYPE_CHECKING:
    from clutchid.verbs.driving import VirtualRecording


@dataclass(frozen=True, slots=True)
class FleetOptions:
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
        Mean time between two recordings of a vehicle, in days.
    workers
        Number of processes for a fleet; does not affect the results.
    no_supply
        Share of the vehicles of a fleet that do not record their supply pressure, from 0 to 1.
    events
        Some of replaced, leak and sensor, with commas: each vehicle has one of them, or none, in the middle half of its
        service, and an exchanged sensor an offset of 0.2 to 0.5 mm. By default they happen by chance.
    spread
        How far each vehicle lies from its type towards another type of its family, from 0 to 1: all vehicles of a type
        are the same truck by default.
    """

    fleet: int = 0
    months: float = 12.0
    types: int = 4
    days: float = 7.0
    workers: int = 1
    no_supply: float = 0.0
    events: str = ""
    spread: float = 0.0


#: No fleet.
_SINGLE = FleetOptions()


@guarded
def drive(
    *,
    out: OutOption,
    family: str = "A",
    truck: int = 0,
    seed: int = 0,
    seconds: float = 30.0,
    wear: float = 0.0,
    cycles: float = 0.0,
    temperature: float | None = None,
    supply: float | None = None,
    manoeuvre: str = "mix",
    change: list[str] | None = None,
    truth: PathOutput = None,
    pressure: Annotated[bool, FILES] = True,
    conditions: Annotated[Flag, FILES] = False,
    bus: Annotated[Flag, FILES] = False,
    dropouts: Annotated[int, FILES] = 0,
    offset: Annotated[float, FILES] = 0.0,
    sensor_zero: Annotated[Literal["learned", "kept"] | None, FILES] = None,
    late: Annotated[float, FILES] = 0.0,
    service: Annotated[FleetOptions, Parameter(name="*"), FLEET] = _SINGLE,
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Make a recording of a virtual truck, whose load is known and which has more physics than the model.

    With --fleet, many vehicles in service: recordings over months and seasons, in which supplies drift, clutches wear
    and are replaced, sensors are exchanged, leaks begin and files go wrong.

    Parameters
    ----------
    out
        Recording to write (.csv or .parquet); with --fleet a new folder.
    family
        A; B, which has other valves, air, friction, springs and sensors; or h:SEED, a hybrid with parts of both.
    truck
        Number of the truck type, with --fleet of the first one; the same number is always the same truck.
    seed
        Seed of manoeuvre, noise and air supply.
    seconds
        Length of the recording in s.
    wear
        Wear of the facing in mm.
    cycles
        Number of strokes that the clutch has done: seals, leaks and springs age with them.
    temperature
        Ambient temperature in °C; that of the truck type by default.
    supply
        Set supply pressure in bar (absolute); that of the truck type by default.
    manoeuvre
        mix, gear-shift, pull-away, creep, staircase, strokes, ramps or validation.
    change
        What has changed since the calibration: supply, cold, warm, valves or seals; may be repeated.
    truth
        JSON file to write: the true load over the travel from the vented rest, supply pressure, wear, temperature,
        touch point, and the offset of the sensor from that travel (rest_shift_m).
    pressure
        Record the chamber pressure as well.
    conditions
        Record ambient temperature and supply pressure as well, with offset and noise of their sensors.
    bus
        Record on the bus at 100 Hz with its own clock, instead of in the controller at 1 kHz.
    dropouts
        Number of intervals of 5 to 60 ms without measurements.
    offset
        Offset of the position sensor in mm, also for the controller, as after a replacement or with a bent
        bracket.
    sensor_zero
        learned: the sensor reads 0 at the vented rest of this recording; kept: it reads 0 at the rest of the new
        clutch, and the rest falls with wear. By default that of the truck: learned, or for a hybrid either.
    late
        Delay of the recorded duty cycles relative to the position, in whole ms.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.verbs.driving import FleetPlan, VirtualRecording, driven, visits

    single = VirtualRecording(
        manoeuvre, wear * 1e-3, cycles, None if temperature is None else temperature + 273.15, pressure,
        "bus" if bus else "controller", dropouts, conditions, tuple(change or ()),
        None if supply is None else supply * 1e5, offset * 1e-3, sensor_zero, late * 1e-3,
    )  # fmt: skip
    if service.fleet:
        from clutchid.verbs.virtual_fleet import write_fleet

        _check_no_single(single, truth)
        events = tuple(filter(None, service.events.split(",")))
        plan = FleetPlan(service.no_supply, events, service.spread)
        fleet = visits(service.fleet, service.months, family, truck, service.types, seed, service.days, plan)
        with progress_of("drive") as progress:
            write_fleet(out, fleet, seconds, service.workers, progress)
        message = f"fleet of {service.fleet} vehicles of family {family}"
    else:
        driven(single, truck, family, seed, seconds, out, truth)
        message = f"recording of truck {truck} of family {family}"
    files = (out,) if truth is None else (out, truth)
    if json:
        print_json({"status": "ok", "message": message, "written": [str(path.resolve()) for path in files]})
    else:
        print_written(*files)
    return DONE


def _check_no_single(single: VirtualRecording, truth: Path | None) -> None:
    """Check that no option of a single recording is given with a fleet."""
    from clutchid.verbs.driving import VirtualRecording

    extra = [name for name, usual in VirtualRecording()._asdict().items() if getattr(single, name) != usual]
    if extra or truth:
        option = {"pressure": "no-pressure", "recorder": "bus"}.get(extra[0], extra[0]) if extra else "truth"
        option = option.replace("_", "-")
        raise ParameterError(
            f"--{option} is for a single recording; the events of a fleet are drawn at random from --seed."
        )
