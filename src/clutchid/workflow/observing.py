"""A whole recording through an observer, as `clutchid observe` and `clutchid.observe` follow it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import DataError
from clutchid.log import Log

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.observer.recording import ObservedRecording
    from clutchid.recordings.strokes.vented_rest import Zero


def fast_enough(log: Log, content: ParameterFile, *, force: bool = False) -> Log:
    """The recording with warnings about its rate and its supply pressure.

    Raises
    ------
    DataError
        If it is too slow for an observer, unless with `force`.
    """
    from clutchid.observer.prior import unused_supply
    from clutchid.observer.recording import too_slow

    slow = too_slow(log, content.actuator)
    if slow and not force:
        raise DataError(f"{slow} Or go on with --force.")
    found = (slow, unused_supply(log, content.actuator, content.calibration))
    return replace(log, warnings=(*log.warnings, *filter(None, found)))


def observed(
    log: Log, content: ParameterFile, method: str = "joint", resume: Path | None = None, zero: Zero = "subtract"
) -> ObservedRecording:
    """Follow a recording with the observer of a calibration, from its first sample or from a saved state.

    Raises
    ------
    DataError, ParameterError
        If recording, calibration, method and state do not fit each other.
    """
    from clutchid.observer.observer import observer
    from clutchid.observer.recording import observe_recording, spacing
    from clutchid.observer.state_file import read_state, saved_spacing

    every = spacing(log) if resume is None else saved_spacing(resume)
    one = observer(content.actuator, method, every, content.calibration, zero)
    return observe_recording(one, log, None if resume is None else read_state(one, resume))
