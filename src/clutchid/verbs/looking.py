"""The verb `look`, for the command line and the page: contents of a file, and the checks before a fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.documents.results import Looked
from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.measurements import QUANTITIES, read_pieces
from clutchid.measurements.look import look
from clutchid.measurements.map.channel_map import read_map, write_map
from clutchid.parameters import known_ambient

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.inference.uncertainty.calibration import Calibration
    from clutchid.measurements.look import FileOverview
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.model.actuator import Actuator
    from clutchid.preparation.inspection import Check, Grade
    from clutchid.strokes.vented_rest import ZeroedLog
    from clutchid.verbs.reading import Reading

__all__ = ["NEEDED", "QUANTITIES", "Looked", "checked_recording", "is_map", "looked", "read_map", "save_proposed"]

#: Columns that the checks of a recording need.
NEEDED = ("time", "position")


def looked(reading: Reading, content: ParameterFile | None = None) -> Looked:
    """Look at the file of a reading, and check it against the calibration `content`, if there is one.

    Raises
    ------
    DataError
        If it cannot be read, or a channel map does not fit it.
    """
    (file,), ambient, dbc = reading.files, reading.ambient, reading.dbc
    channel_map = read_map(reading.channels) if isinstance(reading.channels, Path) else None
    added = known_ambient(content.actuator.parameters.P_0) if content else None
    contents = look(file, added if ambient is None else ambient, dbc, channel_map)

    def read(channels: ChannelMap | None) -> Log:
        return next(read_pieces(file, ambient=ambient, added=added, channels=channels, dbc=dbc, required=NEEDED))

    return checked_recording(contents, channel_map, content, read)


def checks_against(rested: ZeroedLog, actuator: Actuator, calibration: Calibration) -> Iterator[Check]:
    """Checks of a recording against its calibration: travel, supply, and faults of its inputs."""
    from clutchid.estimation.assess.reasons import named_cause, of_no_fault
    from clutchid.estimation.causes import compared_causes
    from clutchid.inference.uncertainty.conditions import gauge_sentence, supply_difference
    from clutchid.preparation.inspection import Check
    from clutchid.strokes.travel import travel_change, travel_of

    log, travel = rested.log, calibration.travel
    if travel is not None and "position" in log:
        change = travel_change(travel, travel_of(log), rested.subtracted)
        grade: Grade = "suspect" if change.suspect else "good" if change.checked else "undetermined"
        yield Check("travel of position", f"{change.ratio:.3f} of the calibrated", grade, change.sentence)
    difference = supply_difference(log, actuator, calibration.conditions)
    if difference is not None:
        value = f"{difference * 1e-5:+.2f} bar"
        yield Check("supply against calibration", value, "suspect", f"{gauge_sentence(difference)}.")
    causes = compared_causes(log, actuator, calibration)
    if not causes:
        return
    value = f"innovations {of_no_fault(causes).innovations:.1f} times those of the calibration"
    if cause := named_cause(causes):
        yield Check("inputs", value, "suspect", f"{cause.sentence}; {cause.remedy}.")
    elif len(causes) > 1:
        sentence = (
            "no fault of the inputs explains it; `clutchid estimate` shows whether the clutch has changed or the "
            "calibration is of another truck."
        )
        yield Check("inputs", value, "undetermined", sentence)
    else:
        yield Check("inputs", value, "good", "the recording agrees with its calibration.")


def is_map(path: Path) -> bool:
    """Whether a file is a channel map."""
    try:
        read_map(path)
    except (DataError, ParameterError):
        return False
    return True


def save_proposed(contents: FileOverview, path: Path) -> ChannelMap:
    """Write the proposed channel map, with what is open and the listing of the file as a comment.

    Raises
    ------
    ExportError
        If the file cannot be written.
    """
    proposed = contents.proposal.channels
    comment = "\n".join((*contents.proposal.open, contents.listing()))
    write_map(replace(proposed, comment=comment), path)
    return proposed


def checked_recording(
    contents: FileOverview,
    channel_map: ChannelMap | None,
    content: ParameterFile | None,
    read: Callable[[ChannelMap | None], Log],
) -> Looked:
    """Checks on the recording; a file that needs a channel map and has none is read with the proposed one.

    Parameters
    ----------
    read
        Reads the recording, or its first million samples, with a channel map.

    Raises
    ------
    DataError
        If a channel map does not fit it.
    """
    from clutchid.preparation.inspection import inspect

    if contents.problems:
        return Looked(contents, unchecked="Not checked: the recording has problems.")
    proposed = contents.proposal.channels
    channels = replace(channel_map, dbc=proposed.dbc) if channel_map else proposed if contents.needs_map else None
    if channels is proposed and "position" not in proposed.channels:
        why = "Not checked: no channel could be identified as the position; a channel map is needed."
        return Looked(contents, unchecked=why)
    try:
        log = read(channels)
    except DataError as error:
        if channel_map or contents.proposal.complete:
            raise
        return Looked(contents, unchecked=f"Not checked, because the proposed channel map does not fit:\n{error}")
    how = "" if contents.proposal.complete or channels is not proposed else " with the proposed channel map"
    inspection = inspect(log, content.actuator, content.rest) if content else inspect(log)
    if content and content.calibration:
        against = checks_against(content.from_rest(log), content.actuator, content.calibration)
        inspection = replace(inspection, checks=(*inspection.checks, *against))
    return Looked(contents, inspection, how=how, log=log)
