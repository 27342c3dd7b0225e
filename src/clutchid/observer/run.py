"""A whole recording through an observer: samples, strokes, faults, and usual values of a calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import NOT_RECORDED
from clutchid.inference.uncertainty.estimates import POINTS, LoadCurve
from clutchid.log import INPUTS, FloatArray, Log, name_and_unit, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.by_stroke import StrokeRow, curve, curve_positions, estimates_of, follow_strokes
from clutchid.observer.configuration import Observer, observer, start
from clutchid.observer.flags import SUPPLY_UNLIKE
from clutchid.observer.following import Observed, observe, subtracted
from clutchid.observer.health import faults_after, health, raised
from clutchid.observer.mismatch import normalised
from clutchid.observer.state import ObserverState
from clutchid.preparation.pulses import Duties, duties_in
from clutchid.strokes.values import ends_stretch, is_value, outside, with_inputs_in_range

#: As many intervals at the start of a recording give the time from one sample to the next, rounded to so many digits:
#: what is known before the recording has ended, and the same for its parts.
_INTERVALS, DIGITS = 100, 3

#: Part by which the time from one sample to the next may differ between the parts of a recording.
_SAME_PACE = 0.1

#: Use of the supply pressure at the end of a recording: "not used" where it cannot be right, too.
SupplyUse = Literal["measured", "lost", "not used", "not recorded"]


@dataclass(frozen=True, slots=True, eq=False)
class ObservedRecording:
    """A recording that an observer has followed.

    Attributes
    ----------
    observer
        The observer, a value that does not change.
    log
        The recording, in which impossible values are missing.
    before, after
        States of the observer before the first and after the last sample.
    samples
        Results by sample.
    strokes
        Results at the end of each stroke.
    health : s
        Seconds of each fault, see `clutchid.observer.health`.
    seconds : s
        That were followed.
    supply
        Use of the recorded supply pressure.
    """

    observer: Observer
    log: Log
    before: ObserverState
    after: ObserverState
    samples: Observed
    strokes: tuple[StrokeRow, ...]
    health: Mapping[str, float]
    seconds: float
    supply: SupplyUse

    @property
    def assumes_supply(self) -> bool:
        """Whether the supply pressure is taken to be that of the calibration: less is taken for a larger load."""
        return self.supply != "measured"

    def deviation(self, symbol: str) -> FloatArray:
        """Standard deviation in SI of a state after each sample, that of the last correction; NaN where unknown."""
        at = self.observer.actuator.states.index(symbol)
        deviations = np.append(self.before.deviations[at], self.samples.deviations[:, at])
        corrected = np.maximum.accumulate(np.where(np.isfinite(deviations), np.arange(deviations.size), 0))
        return np.where(np.isfinite(self.samples.states[:, at]), deviations[corrected[1:]], np.nan)

    @property
    def travel(self) -> Log:
        """The recording with its position as the observer counts it, from the vented rest where that has moved."""
        counted = subtracted(self.observer, self.samples.rest)
        return self.log.with_columns(position=self.log["position"] - counted)

    def estimates(self) -> Log:
        """Samples as a `Log`: the columns of the recording, all states, the band of the pressure, and innovations.

        A recorded column with the name of a state is called ``NAME_measured``.
        """
        rows = self.observer.actuator.state_rows
        states = {row.column: self.samples.states[:, i] for i, row in enumerate(rows.values())}
        recorded = {
            "{}_measured [{}]".format(*name_and_unit(name)) if name in states else name: values
            for name, values in self.log.columns.items()
        }
        pressure, half = states["pressure_a"], QUANTILE * self.deviation("p_A")
        added = {
            "pressure_a low": pressure - half,
            "pressure_a high": pressure + half,
            "innovation": self.samples.innovations[:, 0],
            "innovation std": np.sqrt(self.samples.innovations[:, 1]),
            "used [1]": self.samples.used.astype(np.float64),
            "nis_ratio [1]": self.samples.mismatch,
            "rest_shift [m]": self.samples.rest,
        }
        columns = {"position": states.pop("position"), **recorded, **states, **added}
        return Log(self.log.time, columns, self.log.name, self.log.metadata)

    def load_by_stroke(self) -> Log:
        """Strokes as a `Log`, a row at the end of each.

        Columns are the number of the ``stroke``, each load weight and parameter that adapts with its standard deviation
        ``NAME_std``, and the load with its 95 % band at each position of the grid in micrometres: ``load_5000um``,
        ``load_5000um_low`` and ``load_5000um_high``.
        """
        actuator, rows = self.observer.actuator, self.strokes
        columns = {"stroke [1]": np.array([row.number for row in rows], dtype=np.float64)}
        for name in estimates_of(self.observer, self.before):
            unit = actuator.unit(name)
            columns[f"{name} [{unit}]"] = np.array([row.estimates[name].value for row in rows])
            columns[f"{name}_std [{unit}]"] = np.array([row.estimates[name].std for row in rows])
        for side, suffix in (("force", ""), ("low", "_low"), ("high", "_high")):
            for i, position in enumerate(curve_positions(self.observer).tolist()):
                values = np.array([getattr(row.curve, side)[i] for row in rows])
                columns[f"load_{round(position * 1e6):05d}um{suffix} [N]"] = values
        return Log(np.array([row.time for row in rows]), columns, f"{self.log.name}.load", self.log.metadata)


class Loads(NamedTuple):
    """The load of the calibration, before the first sample of a recording, and after its last one.

    Each at 101 points from 0 to the full stroke.
    """

    calibrated: LoadCurve
    before: LoadCurve
    after: LoadCurve


def loads(run: ObservedRecording) -> Loads:
    """The loads of a recording."""
    position = np.linspace(0.0, run.observer.actuator.parameters.y_max, POINTS)
    return Loads(*(curve(run.observer, state, position) for state in (start(run.observer), run.before, run.after)))


def spacing(log: Log) -> float:
    """Time in s from one sample of a recording to the next, from its first samples.

    Raises
    ------
    DataError
        If there are fewer than two samples.
    """
    if len(log) < 2:
        raise DataError(
            f"{log.name}: {len(log)} samples; an observer needs at least two, to determine the interval between "
            "samples."
        )
    return float(f"{sample_interval(log.time[: _INTERVALS + 1]):.{DIGITS}g}")


def too_slow(log: Log, actuator: Actuator) -> str:
    """Reason why a recording is too slow for an observer of a calibrated actuator, in a sentence; else nothing."""
    if duties_in(log, actuator) is Duties.RECORDED:
        return ""
    return (
        f"{log.name}: a sample every {spacing(log) * 1e3:.3g} ms does not show every change of the duty cycles, and an "
        "observer cannot wait for the next sample to interpolate: the load would have errors of tens of percent. "
        "Record at 1 kHz, or read the load off line: clutchid estimate LOG --start CAL.toml."
    )


def recorded(log: Log, column: str) -> bool:
    """Whether a recording has a column with values."""
    return bool(np.isfinite(log.columns.get(column, np.zeros(0))).any())


def unused_conditions(observer: Observer, log: Log) -> tuple[str, ...]:
    """Reasons why an observer does not use the supply pressure and air temperature of a recording, a sentence each."""
    conditions = observer.calibration.conditions if observer.calibration else NOT_RECORDED
    by_model = "" if "p_S" in observer.actuator.states else ", because the supply pressure of the model is constant"
    lacking = ", because the calibration does not have it; record it there too"
    unsaved = ", because the calibration was saved before observers used it; save it again"
    of_supply = by_model or (lacking if conditions.supply is None else unsaved)
    rows = (
        ("pressure_supply", observer.supply, of_supply, "A lower supply pressure then looks like a larger load."),
        ("temperature_ambient", observer.air, lacking, "Warmer air then looks like a smaller load."),
    )
    return tuple(
        f"{log.name}: {column} is not used{why}. {effect}"
        for column, use, why, effect in rows
        if use is None and recorded(log, column)
    )


def observe_recording(observer: Observer, log: Log, state: ObserverState | None = None) -> ObservedRecording:
    """Follow a recording from a state, by default that before the first sample of all.

    Raises
    ------
    DataError
        As `observe`; and if it is sampled at another rate than the observer's, or no sample has the position and both
        duty cycles.
    """
    before = start(observer) if state is None else state
    check_pace(observer, log)
    run = follow_block(observer, before, with_inputs_in_range(log))
    if not usable(log):
        raise DataError(no_sample(log.name))
    return run


def duration(observer: Observer, time: FloatArray) -> float:
    """Time in s from the first sample to the end of the last one, 0 without samples."""
    return float(time[-1] - time[0]) + observer.spacing if time.size else 0.0


def check_pace(observer: Observer, log: Log) -> None:
    """Check that a recording, or its first samples, is sampled at the rate of the observer.

    Raises
    ------
    DataError
        If it is not.
    """
    if len(log) > 1 and abs(spacing(log) / observer.spacing - 1.0) > _SAME_PACE:
        raise DataError(
            f"{log.name}: a sample every {spacing(log) * 1e3:.3g} ms, but the observer was started with one every "
            f"{observer.spacing * 1e3:.3g} ms; go on with a recording at the same rate, or start anew."
        )


def usable(log: Log) -> bool:
    """Whether a recording has a sample with the position and both duty cycles."""
    return bool(np.all([np.isfinite(log[name]) for name in ("position", *INPUTS)], axis=0).any())


def no_sample(name: str) -> str:
    """Fault of a recording that is not `usable`, in a sentence."""
    return f"{name}: no sample has a position and both duty cycles, all finite; there is nothing to observe."


def follow_block(observer: Observer, before: ObserverState, log: Log) -> ObservedRecording:
    """Follow a part of a recording, of any length.

    Raises
    ------
    DataError
        As `observe`.
    """
    after, samples, rows = follow_strokes(observer, before, log)
    values = _values(log, samples)
    flagged = raised(observer, values, samples)
    after = after._replace(faults=faults_after(before.faults, observer, flagged, samples.ends))
    fault_seconds = health(observer, flagged, samples)
    seconds = duration(observer, log.time)
    supply = _supply_use(after, log)
    return ObservedRecording(observer, values, before, after, samples, tuple(rows), fault_seconds, seconds, supply)


def _supply_use(after: ObserverState, log: Log) -> SupplyUse:
    """Use of the supply pressure after a part of a recording."""
    intake = after.inputs.intake
    if intake.supply_recorded:
        return "measured"
    if intake.supply_known and not intake.supply_unlike:
        return "lost"
    return "not used" if intake.supply_known or recorded(log, "pressure_supply") else "not recorded"


def _values(log: Log, samples: Observed) -> Log:
    """A part of a recording in which impossible values are missing; the same object if there are none."""
    verdicts = samples.verdicts
    wrong = {"position": ~is_value(verdicts), **dict.fromkeys(INPUTS, ends_stretch(verdicts))}
    if "pressure_supply" in log:
        wrong["pressure_supply"] = samples.flagged(SUPPLY_UNLIKE) | outside("pressure_supply", log["pressure_supply"])
    columns = {name: np.where(mask, np.nan, log[name]) for name, mask in wrong.items() if mask.any()}
    return log.with_columns(**columns) if columns else log


def usual_nis(actuator: Actuator, calibration: Calibration, logs: Sequence[Log]) -> float:
    """Mean normalised innovation squared of the method 'joint' while the piston moves in the calibration recordings.

    Recordings that cannot be observed are left out; NaN where none is left.
    """
    parts = []
    for log in logs:
        with suppress(DataError, ParameterError):  # a calibration is not lost for it
            parts.append(_nis(actuator, calibration, log))
    together = np.concatenate(parts) if parts else np.empty(0)
    finite = together[np.isfinite(together)]
    return float(np.mean(finite)) if finite.size else float("nan")


def _nis(actuator: Actuator, calibration: Calibration, log: Log) -> FloatArray:
    if not usable(log) or too_slow(log, actuator):
        return np.empty(0)
    compared = observer(actuator, "joint", spacing(log), calibration)
    _, samples = observe(compared, start(compared), log)
    return normalised(compared, samples.states, samples.innovations)
