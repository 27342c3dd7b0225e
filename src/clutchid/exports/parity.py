"""The observer in C against the one in Python on a recording: worst differences, each with its sample."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from clutchid.codegen.c99 import CSource
from clutchid.codegen.records import record_copy
from clutchid.codegen.templates import template
from clutchid.errors import ExportError
from clutchid.exports.c99 import CStyle, source_files
from clutchid.exports.outputs import OUTPUTS
from clutchid.inference.filter.joint_filter import drifted
from clutchid.log import FloatArray, Log
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.by_stroke import curve, curve_positions
from clutchid.observer.configuration import Observer, start
from clutchid.observer.flags import FLAGS
from clutchid.observer.mismatch import mismatch_from
from clutchid.observer.run import follow_block
from clutchid.observer.state import ObserverState, Sound

#: Standard deviation of the position sensor's noise in the trial drive in m.
_SENSOR_NOISE = 1e-5

#: Columns of a recording that the C is given.
_SAMPLE = ("position", "duty_supply", "duty_exhaust", "pressure_supply", "temperature_ambient")

#: Columns of the results of a sample in C, see ``replay.c``.
RESULT_COLUMNS = tuple(OUTPUTS)

#: Fields of NAME_band_t: the load, its band, and that if the supply is as calibrated.
BAND = 5

#: Largest differences that are rounding: of theta in prior standard deviations, of the load as a share of its peak, of
#: the pressure in Pa, rms; by type of numbers.
BOUNDS = {"double": (1e-6, 1e-9, 1e-3), "float": (3e-2, 2e-3, 30.0)}


class Replayed(NamedTuple):
    """Results of the C: outputs by sample (n, outputs), load with its bands (m, 5), theta (k,), samples by flag."""

    outputs: FloatArray
    load: FloatArray
    theta: FloatArray
    health: FloatArray


class Difference(NamedTuple):
    """The largest difference of a quantity.

    Attributes
    ----------
    name
        The quantity.
    value, unit
        Its size, and the unit.
    sample
        Where it is; None for one at the end.
    """

    name: str
    value: float
    unit: str
    sample: int | None


class Parity(NamedTuple):
    """C against Python on a recording.

    Attributes
    ----------
    recording, samples
        Its name and number of samples.
    theta : 1
        Largest difference of what adapts, in prior standard deviations.
    load : 1
        Difference of the load, as a share of its peak.
    pressure : Pa
        Difference of the pressure, rms.
    pressure_share : 1
        Difference of the pressure as a share of its standard deviation, rms.
    differences
        The largest ones by quantity.
    flags
        Samples by flag in Python and in C, where they differ.
    strokes
        Strokes that Python and C counted.
    """

    recording: str
    samples: int
    theta: float
    load: float
    pressure: float
    pressure_share: float
    differences: tuple[Difference, ...]
    flags: Mapping[str, tuple[int, int]]
    strokes: tuple[int, int]

    def holds(self, style: CStyle) -> bool:
        """Whether all differences are rounding."""
        theta, load, pressure = BOUNDS[style.real]
        alike = not self.flags and self.strokes[0] == self.strokes[1]
        return alike and self.theta <= theta and self.load <= load and self.pressure <= pressure


def begun(observer: Observer, saved: ObserverState) -> ObserverState:
    """The state that an export begins with: what a saved one knows of parameters, strokes and the zero."""
    fresh = start(observer)
    sound = Sound(saved.theta, drifted(observer.joint, saved.T, saved.wear), saved.G, fresh.wear)
    shift = saved.zero if observer.zero == "subtract" else saved.rest_shift
    intake = record_copy(fresh.inputs.intake, jumped=saved.jumped, unzeroed=saved.unzeroed)
    fresh = fresh._replace(
        **sound._asdict(), sound=sound, strokes=saved.strokes, nis=mismatch_from(saved.nis.stored), zero=saved.zero,
        inputs=fresh.inputs._replace(intake=intake, rest=record_copy(fresh.inputs.rest, shift=shift)),
    )  # fmt: skip
    return fresh._replace(leaking=observer.leaks(fresh))


def trial_drive(observer: Observer, period: float = 1.3, vents: float = 0.5, seconds: float = 4.0) -> Log:
    """Duty cycles and position of a drive with strokes, as the calibrated actuator makes it, in SI.

    A stroke takes a period in s; the exhaust valve is open for the time `vents` in s.
    """
    from clutchid.simulation import simulate
    from clutchid.simulation.sensors import lagged

    actuator, spacing = observer.actuator, observer.spacing
    time: FloatArray = spacing * np.arange(round(seconds / spacing), dtype=np.float64)
    within = time % period
    duties = {
        "duty_supply": np.where((within > 0.1) & (within < 0.35), 1.0, 0.0),
        "duty_exhaust": np.where((within > 0.6) & (within < 0.6 + vents), 1.0, 0.0),
    }
    log = Log(time, duties, "trial drive")
    position = lagged(simulate(actuator, log).log["position"], actuator.parameters.tau_y, spacing)
    # without noise a piston that stands is taken for a frozen sensor, in float before it is in double
    noise = _SENSOR_NOISE * np.random.default_rng(0).standard_normal(len(log))
    return log.with_columns(position=position + noise)


def microseconds(log: Log) -> FloatArray:
    """Time of each sample since the one before in whole microseconds, as a control unit counts it; 0 first."""
    return np.diff(np.round(log.time * 1e6), prepend=np.round(log.time[0] * 1e6))


def begins_us(log: Log) -> int:
    """Time in us since a period of the valves' carrier began at the first sample, as its phase counts from time 0."""
    return int(np.round(log.time[0] * 1e6) % 2**31)


def samples_of(log: Log) -> FloatArray:
    """The samples of a recording for the C, shape (n, 6): `_SAMPLE`, and microseconds since the last one."""
    columns = [log.columns.get(name, np.full(len(log), np.nan)) for name in _SAMPLE]
    return np.column_stack([*columns, microseconds(log)])


def replay_source(observer: Observer, style: CStyle, begins: int) -> str:
    """The program in C that follows recordings whose clock begins at these microseconds."""
    values = {
        **style.values,
        "positions": curve_positions(observer).tolist(),
        "begins_us": begins,
        "outputs": RESULT_COLUMNS,
    }
    return template("replay.c.j2", "clutchid.exports").render(values)


def replay(observer: Observer, modules: Mapping[str, CSource], style: CStyle, log: Log, cc: str) -> Replayed:
    """Compile an observer with a program that follows a recording, and run it.

    Raises
    ------
    ExportError
        If it does not compile or run.
    """
    with tempfile.TemporaryDirectory() as folder:
        return replayed(replay_program(observer, modules, style, begins_us(log), cc, Path(folder)), observer, log)


def replay_program(
    observer: Observer, modules: Mapping[str, CSource], style: CStyle, begins: int, cc: str, folder: Path
) -> Path:
    """An observer compiled with the program that follows recordings whose clock begins at these microseconds.

    It is not optimised: it compiles in a quarter of the time, and computes the same numbers.

    Raises
    ------
    ExportError
        If it does not compile.
    """
    for file, text in (source_files(modules) | {"replay.c": replay_source(observer, style, begins)}).items():
        (folder / file).write_text(text, encoding="utf-8")
    sources = [str(path) for path in sorted(folder.glob("*.c"))]
    _checked([cc, "-std=c99", "-O0", "-ffp-contract=off", "-o", str(folder / "replay"), *sources, "-lm"], b"")
    return folder / "replay"


def replayed(program: Path, observer: Observer, log: Log) -> Replayed:
    """The outputs of a `replay_program` for a recording.

    Raises
    ------
    ExportError
        If it fails.
    """
    values = np.frombuffer(_checked([str(program)], samples_of(log).tobytes()))
    n, m = len(log) * len(RESULT_COLUMNS), BAND * curve_positions(observer).size
    outputs, load, rest = values[:n], values[n : n + m], values[n + m :]
    return Replayed(
        outputs.reshape(-1, len(RESULT_COLUMNS)), load.reshape(-1, BAND), rest[: -len(FLAGS)], rest[-len(FLAGS) :]
    )


def _checked(command: list[str], stdin: bytes) -> bytes:
    run = subprocess.run(command, input=stdin, capture_output=True, check=False)
    if run.returncode != 0:
        words = run.stderr.decode(errors="replace").strip().splitlines()
        raise ExportError(f"{Path(command[0]).name} failed on the exported C: {words[0] if words else run.returncode}.")
    return run.stdout


def parity(observer: Observer, state: ObserverState, log: Log, in_c: Replayed) -> Parity:
    """Compare the results of the C on a recording with those of Python."""
    run = follow_block(observer, state, log)
    after, expected = run.after, run.samples
    names = observer.actuator.states
    at = [names.index(name) for name in ("p_A", "y", "v")]
    std = np.sqrt(expected.innovations[:, 1])
    columns = {
        "pressure_a": (expected.states[:, at[0]], "Pa"),
        "position": (expected.states[:, at[1]], "m"),
        "velocity": (expected.states[:, at[2]], "m/s"),
        "innovation": (expected.innovations[:, 0], "m"),
        "innovation_std": (std, "m"),
        "rest": (expected.rest, "m"),
    }
    differences = [
        _worst(name, in_c.outputs[:, RESULT_COLUMNS.index(name)], *column) for name, column in columns.items()
    ]
    load = curve(observer, after, curve_positions(observer))
    half = QUANTILE * observer.load_deviation(after, curve_positions(observer), as_calibrated=True)
    band = np.stack([load.force, load.low, load.high, load.force - half, load.force + half], axis=1)
    differences.append(Difference("load and band", float(np.abs(in_c.load - band).max()), "N", None))
    prior = np.linalg.norm(observer.prior.root, axis=1)
    counts = {name: round(value / observer.spacing) for name, value in run.health.items()}
    flags = {
        name: (expected_count, int(count))
        for (name, expected_count), count in zip(counts.items(), in_c.health, strict=True)
        if expected_count != count
    }
    pressure, pressure_std = in_c.outputs[:, 0] - expected.states[:, at[0]], in_c.outputs[:, 1]
    return Parity(
        recording=log.name,
        samples=len(log),
        theta=float(np.abs((in_c.theta - after.theta) / prior).max(initial=0.0)),
        load=float(np.abs(in_c.load[:, 0] - load.force).max() / np.abs(load.force).max()),
        pressure=_rms(pressure),
        pressure_share=_rms(pressure / pressure_std),
        differences=tuple(differences),
        flags=flags,
        strokes=(after.strokes, int(in_c.outputs[-1, RESULT_COLUMNS.index("strokes")])),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else 0.0


def _worst(name: str, in_c: FloatArray, expected: FloatArray, unit: str) -> Difference:
    difference = np.abs(in_c - expected)
    if not np.isfinite(difference).any():
        return Difference(name, 0.0, unit, None)
    at = int(np.nanargmax(difference))
    return Difference(name, float(difference[at]), unit, at)
