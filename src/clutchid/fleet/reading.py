"""Read the load of one recording from a calibration; whatever happens is a value."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid import workflow
from clutchid.assess.half_load import HalfLoad
from clutchid.errors import ClutchidError, DataError, ParameterError
from clutchid.estimate.request import FitRequest
from clutchid.io.files import digest
from clutchid.wear.life import Curve, Reading
from clutchid.wear.measurement import measured

if TYPE_CHECKING:
    from clutchid.estimate.parameter_file import ParameterFile


class How(NamedTuple):
    """The calibration to start from, and how recordings are read: ambient pressure in Pa, channel map, DBC files."""

    start: Path
    ambient: float
    channel_map: Path | None = None
    dbc: tuple[Path, ...] = ()


class Read(NamedTuple):
    """A recording that was read: what came of it, the start time in its file, its checksum, its load, and changes."""

    path: Path
    reading: Reading
    clock: str = ""
    sha256: str = ""
    curve: Curve | None = None
    half_load: HalfLoad = HalfLoad(np.nan, np.nan, np.nan)
    changes: tuple[str, ...] = ()


def read_recording(how: How, path: Path) -> Read:
    """Read the load of a recording from position alone; a fault is a status with its sentence."""
    clock = checksum = ""
    try:
        checksum = digest(path)
        content = _calibration(how.start)
        how_to_read = workflow.Reading(how.ambient, how.channel_map, how.dbc)
        (log,) = workflow.read_recordings([path], how_to_read, content.actuator.equipment)
        clock = str(log.metadata.get("start", ""))
        request = FitRequest(calibration=content.calibration)
        fit = workflow.fit_recordings([log], content.actuator, request).fit
    except ClutchidError as error:
        status = "bad_input" if isinstance(error, DataError | ParameterError) else "failed"
        return Read(path, Reading(status, str(error), "none", None), clock, checksum)
    except Exception as error:  # a fleet goes on
        sentence = f"an error that clutchid did not expect, {type(error).__name__}: {error}."
        return Read(path, Reading("failed", sentence, "none", None), clock, checksum)
    curve, nothing = fit.load_curve, HalfLoad(np.nan, np.nan, np.nan)
    half = fit.comparison.half_now if fit.comparison else nothing
    trust = fit.verdict.trust
    message = fit.message if trust == "good" or not fit.verdict.reasons else fit.verdict.reasons[0]
    status = "warning" if fit.warnings or trust != "good" else "ok"
    measurement = measured(fit, log) if trust != "none" else None
    changes = tuple(dict.fromkeys(change.group for change in fit.changes))
    return Read(
        path, Reading(status, message, trust, measurement), clock, checksum,
        Curve(curve.position, curve.force, curve.low, curve.high), half, changes,
    )  # fmt: skip


@cache
def _calibration(path: Path) -> ParameterFile:
    """A calibration, read once a process."""
    return workflow.start_file(path, None)
