"""`drive`: record a truck in a manoeuvre; `respond`: with given duty cycles; `life`: at several ages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Literal

import numpy as np

from clutchid.arguments import checked
from clutchid.errors import ParameterError
from clutchid.log import FloatArray, Log
from clutchid.truck import recorder as recording
from clutchid.truck.assembly import at_rest, load_curve, true_states
from clutchid.truck.changes import aged, changed
from clutchid.truck.families import truck as numbered
from clutchid.truck.load_table import LoadTable
from clutchid.truck.manoeuvres import ClutchPoints, set_point
from clutchid.truck.running import TruckRun, learned_zero, run_truck
from clutchid.truck.settings import SAMPLE, Course
from clutchid.truck.truth import Truth, truth_of, write_truth
from clutchid.truck.vehicle import Vehicle

#: Longest drive in s: an hour needs half a gigabyte.
_LONGEST = 3600.0
#: Largest number of dropouts per second: each lasts 5 ms or longer.
_MOST_DROPOUTS = 20
#: Distance in m between the far stop and the largest set point.
_MARGIN = 2e-3
#: Largest offset of the position in m, and largest delay of the duty cycles in s: faults, not another actuator.
_MOST_OFFSET, _MOST_LATE = 5e-3, 0.1


#: Zero of a position sensor: learned at this vented rest, or kept from the new clutch.
SensorZero = Literal["learned", "kept"]


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A recording of a virtual truck and, separately, its truth.

    Attributes
    ----------
    log
        What the control unit or the bus records.
    truth
        Load and states without sensors.
    wanted : m, (n,)
        Set point, relative to the sensor's zero.
    """

    log: Log
    truth: Truth
    wanted: FloatArray

    def write_truth(self, path: str | PathLike[str], stem: str = "") -> None:
        """Write the truth as JSON, under the name `stem` (default: the log's), see `clutchid.truck.write_truth`.

        Raises
        ------
        ExportError
            If the file cannot be written; an older file is then unchanged.
        """
        write_truth({stem or self.log.name: self.truth}, path)


@checked
def drive(
    truck: Vehicle | int, *, family: str = "A", manoeuvre: str = "mix", seconds: float = 30.0, seed: int = 0,
    wear: float = 0.0, cycles: float = 0.0, temperature: float | None = None, pressure: bool = True,
    recorder: Literal["controller", "bus"] = "controller", dropouts: int = 0,
    stuck: tuple[float, float] | None = None, conditions: bool = False, change: str | Sequence[str] = (),
    supply: float | None = None, offset: float = 0.0, sensor_zero: SensorZero | None = None, late: float = 0.0,
    duties: FloatArray | None = None, name: str = "drive",
) -> Drive:  # fmt: skip
    """Drive `truck` in a closed position loop and record it.

    Parameters
    ----------
    truck : Vehicle or int
        A truck, or the number of one of the `family`, see `clutchid.truck.truck`.
    family : name
        Of the fleet that a number is of, see `clutchid.truck.truck`.
    manoeuvre : name
        One of `clutchid.truck.MANOEUVRES`; "mix" combines all of them.
    seconds : s
        Length of the recording, 0.5 to 3600.
    seed : int
        Seed of manoeuvre, noise, governor and clock. The same seed gives the same recording.
    wear, cycles : m, 1
        Wear of the facing and number of strokes, added to those of the truck, see `aged`.
    temperature : K, optional
        Ambient temperature instead of that of the truck.
    pressure : bool
        Whether the recording includes the chamber pressure.
    recorder : 'controller' or 'bus'
        1 kHz in the controller, or 100 Hz on the bus, with its own clock.
    dropouts : int
        Number of intervals of 5 to 60 ms without measurements (NaN).
    stuck : (s, s), optional
        Start and end of the time for which the position sensor is stuck, also for the controller.
    conditions : bool
        Whether the recording includes ambient temperature and supply pressure.
    change : str or several
        What has changed since the calibration, by the names in `clutchid.truck.CHANGES`.
    supply : Pa, optional
        Set supply pressure (absolute) instead of that of the truck.
    offset : m
        Added to what the position sensor reads, for the controller too: an exchanged sensor or a bent bracket.
    sensor_zero : 'learned' or 'kept', optional
        Whether the sensor's zero is learned at this vented rest, or still that of the new clutch, from which the rest
        falls with wear; that of the truck by default, which is learned in families A and B.
    late : s
        Delay of the recorded duty cycles against the position, in whole ms.
    duties : 1, (n, 2), optional
        Duty cycles of supply and exhaust at every millisecond, such as those of an earlier drive, instead of those of
        the position loop: rounding may turn a quantised reading, after which a closed loop takes another course.
    name : str
        Name of the recording.

    Returns
    -------
    drive : Drive
        The recording, the truth apart from it, and the set point.

    Raises
    ------
    ParameterError
        For an impossible truck or option, wear beyond the facing, or an unknown manoeuvre or change.
    SolveError
        If the simulation produces values that are not finite.

    Examples
    --------
    >>> from clutchid.truck import Truck
    >>> done = drive(Truck(), manoeuvre="gear-shift", seconds=2.0)
    >>> len(done.log), f"{done.truth.states['position'].max() * 1e3:.0f} mm"
    (2000, '21 mm')
    """
    _check(seconds, seed, dropouts, recorder, stuck)
    _check_sensors(offset, late)
    kind = numbered(truck, family) if isinstance(truck, int) else truck
    truck = aged(kind, wear, cycles).replace({} if temperature is None else {"T_0": temperature})
    truck = truck.replace({} if supply is None else {"P_S": supply})
    truck = truck.replace({} if sensor_zero is None else {"zero": sensor_zero})
    truck = changed(truck, *((change,) if isinstance(change, str) else change))
    curve, sensor = load_curve(truck), truck.parts.sensor
    seeds = np.random.SeedSequence(seed).spawn(5)
    of_course, of_noise, of_air, of_recorder, of_conditions = map(np.random.default_rng, seeds)
    points = ClutchPoints(curve.touch - curve.rest, truck.y_max - curve.rest - _MARGIN)
    wanted = set_point(manoeuvre, seconds, points, of_course)
    noise = sensor.position_noise(truck, wanted.size, of_noise)
    shift = offset + (_fallen(truck, curve) if truck.zero == "kept" else 0.0)
    forced = np.full((wanted.size, 2), np.nan) if duties is None else _duties(duties, wanted.size)
    course = Course(wanted, forced, noise, _samples(stuck), shift)
    p_S, working = truck.parts.supply.start(truck, of_air)
    driven = run_truck(truck, course, start=at_rest(truck, curve, p_S), working=working)
    read = sensor.measured_pressure(truck, driven.outputs.pressure, of_air) if pressure else None
    log = _recorded(driven, read, name, {"manoeuvre": manoeuvre, "seed": str(seed), "recorder": recorder})
    log = recording.with_late_duties(log, round(late / SAMPLE))
    if conditions:
        true = true_states(truck, driven.columns)["pressure_supply"]
        log = log.with_columns(**recording.measured_conditions(truck, true, of_conditions))
    if recorder == "bus":
        log = recording.bus_log(truck, log, of_recorder)
    if dropouts:
        log = recording.with_dropouts(log, dropouts, of_recorder)
    return Drive(log, truth_of(truck, curve, driven), wanted)


def respond(truck: Vehicle, duty_supply: FloatArray, duty_exhaust: FloatArray) -> Drive:
    """Response of `truck` from the engaged rest to duty cycles given at every millisecond, recorded without noise.

    A duty cycle is held over each period (`T_pwm`), as in the timer of the valves, unless those of the truck are
    continuous.

    Raises
    ------
    ParameterError
        If the duty cycles are not two columns of the same length within 0 to 1.
    SolveError
        If the simulation produces values that are not finite.

    Examples
    --------
    Fully open, the supply valve drives the piston 20 mm in 0.13 s:

    >>> from clutchid.truck import Truck
    >>> stroke = respond(Truck(), np.ones(300), np.zeros(300))
    >>> f"{stroke.log.time[np.argmax(stroke.truth.states['position'] > 0.02)]:.2f} s"
    '0.13 s'
    """
    forced = _duties(np.column_stack([duty_supply, duty_exhaust]))
    curve, nothing = load_curve(truck), np.zeros(len(forced))
    response = run_truck(truck.replace({"q_y": 0.0}), Course(nothing, forced, nothing))
    return Drive(
        _recorded(response, response.outputs.pressure, "response", {}), truth_of(truck, curve, response), nothing
    )


def _duties(duties: FloatArray, size: int | None = None) -> FloatArray:
    """Duty cycles, shape (n, 2); ParameterError if they are not such, or not of `size` samples."""
    forced = np.asarray(duties, dtype=np.float64)
    shape = max(2, len(forced)) if size is None else size, 2
    if forced.shape != shape or not np.all((forced >= 0) & (forced <= 1)):
        many = "at least 2" if size is None else size
        raise ParameterError(f"duty cycles: two columns of {many} values between 0 and 1 are needed.")
    return forced


def _samples(span: tuple[float, float] | None) -> tuple[int, int]:
    """Start and end as sample indices, or (-1, -1)."""
    return (-1, -1) if span is None else (round(span[0] / SAMPLE), round(span[1] / SAMPLE))


def _fallen(truck: Vehicle, curve: LoadTable) -> float:
    """Shift of the vented rest in m since the clutch was new: below 0, for it falls with wear."""
    new = truck.replace({"wear": 0.0, "cycles": 0.0})
    return learned_zero(truck, curve) - learned_zero(new, load_curve(new))


def _recorded(motion: TruckRun, pressure: FloatArray | None, name: str, metadata: dict[str, str]) -> Log:
    duty_supply, duty_exhaust = motion.outputs.duties.T
    columns = {"position": motion.outputs.measured, "duty_supply": duty_supply, "duty_exhaust": duty_exhaust}
    return Log(motion.time, columns if pressure is None else {**columns, "pressure_a": pressure}, name, metadata)


def _check(seconds: float, seed: int, dropouts: int, recorder: str, stuck: tuple[float, float] | None) -> None:
    length, most = 0.5 <= seconds <= _LONGEST, _MOST_DROPOUTS
    many, order = length and not 0 <= dropouts <= most * seconds, stuck is None or 0 <= stuck[0] < stuck[1]
    checks = (
        (length, f"seconds = {seconds:g}: a drive lasts 0.5 to {_LONGEST:g} s."),
        (not many, f"dropouts = {dropouts}: must be at least 0, and at most {most} a second."),
        (seed >= 0, f"seed = {seed}: must be an integer of at least 0."),
        (recorder in ("controller", "bus"), f"recorder = {recorder!r}: must be controller or bus."),
        (order, f"stuck = {stuck}: give start and end in s, with start before end."),
    )
    ParameterError.raise_for(text for holds, text in checks if not holds)


def _check_sensors(offset: float, late: float) -> None:
    whole = 0.0 <= late <= _MOST_LATE and abs(late / SAMPLE - round(late / SAMPLE)) < 1e-6
    most, longest = _MOST_OFFSET * 1e3, _MOST_LATE * 1e3
    checks = (
        (abs(offset) <= _MOST_OFFSET, f"offset = {offset * 1e3:g} mm: at most {most:g} mm either way."),
        (whole, f"late = {late * 1e3:g} ms: must be a whole number of ms from 0 to {longest:g}."),
    )
    ParameterError.raise_for(text for holds, text in checks if not holds)
