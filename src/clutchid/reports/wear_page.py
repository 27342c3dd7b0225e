"""Page of the wear of a clutch: trend, alarms and forecast, loads from new to now, recordings."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from clutchid.recordings.files import write_text
from clutchid.reports.figures import svg
from clutchid.reports.html import Block, Notice, Page, Picture, Section, Text, escape, render
from clutchid.reports.link import Link
from clutchid.reports.provenance import provenance
from clutchid.reports.style import MM
from clutchid.reports.tables import Cell, Column, Table
from clutchid.reports.wear_figures import loads_figure, trend_figure
from clutchid.reports.wear_text import alarm_words, change_words, left_words, recordings_words
from clutchid.wear.life import Curve, Wear
from clutchid.wear.settings import FALSE_ALARMS

_TREND = (
    "Readings of single recordings, and the trend with its 95 % band. Readings may all lie to one side of the trend: "
    "it is without the error that the readings of a vehicle share and the one that goes with the air temperature, as "
    "far as these can be estimated, and its band contains what is not known of them."
)
_ALARMS = " Red and dashed: alarms."
_LOADS = (
    "Load over the position of the piston, as read from recordings evenly over the life, from dark to light. Shaded: "
    "5 to 8 mm, where the clutch engages."
)


def wear_page(
    wear: Wear, curves: Sequence[tuple[str, Curve]], command: str, path: str | PathLike[str], home: str = ""
) -> None:
    """Write the page of a clutch's wear as one self-contained HTML file.

    Parameters
    ----------
    curves
        Loads of the recordings that count, by name, in order.
    command
        The command line that repeats the run, shown on the page.
    home
        Path of the page of the fleet, relative to this one, which then leads there.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    write_text(render(page_of(wear, curves, command, home)), path)


def page_of(wear: Wear, curves: Sequence[tuple[str, Curve]], command: str, home: str = "") -> Page:
    """The page before it is rendered."""
    sections = [Section("Wear", _result(wear))]
    if curves:
        sections.append(Section("Load from new to now", (Picture(svg(loads_figure(curves)), _LOADS, "Loads"),)))
    sections.append(Section("Recordings", (recordings_table(wear),)))
    title = f"Wear of the clutch of {wear.vehicle}" if wear.vehicle else "Wear of a clutch"
    fleet = Link("Back to the fleet", home) if home else None
    return Page(title, f"Recordings: {recordings_words(wear)}", tuple(sections), provenance([], command), fleet)


def _result(wear: Wear) -> tuple[Block, ...]:
    blocks: list[Block] = [Notice(_capital(warning)) for warning in wear.warnings]
    if not any(wear.counted):
        return (*blocks, Notice("No recording determines the wear.", "failed"))
    blocks += [Notice(f"{_capital(words)}.") for words in map(alarm_words, wear.alarms)]
    if not wear.alarms:
        blocks.append(Notice("No sudden change of the load was found, and no leak.", "ok"))
    blocks.append(Text(f"The test for changes is set to one false alarm in {1 / FALSE_ALARMS:,.0f} recordings."))
    words, left = change_words(wear), left_words(wear)
    blocks.append(Text(escape(f"{_capital(words)}.{f' Left: {left}.' if left else ''}")))
    caption = f"{_TREND}{_ALARMS if wear.alarms else ''}"
    return (*blocks, Picture(svg(trend_figure(wear)), caption, "Trend of the wear with its band"))


def _capital(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}"


def recordings_table(wear: Wear) -> Table:
    """A row a recording, with why it does not count, or a message where it is not only that the fit converged."""
    columns = (
        Column("recording", "recording"), Column("begin", "begin", date=True),
        Column("strokes [1]", "strokes", decimals=0), Column("shift [m]", "shift\n[mm]", MM, 3),
        Column("load [1]", "load\n[%]", 0.01, 1), Column("trust", "trust"),
        Column("outcome", "in the trend"), Column("message", "reason or message"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for dated, one, outcome, reason in zip(wear.dated, wear.readings, wear.outcomes, wear.reasons, strict=True):
        begin = f"{dated.begin:%Y-%m-%d}" if dated.begin else None
        shift, load = (one.measurement.shift, one.measurement.load) if one.measurement else (None, None)
        message = reason or ("" if one.status == "ok" else one.message)
        rows.append((dated.name, begin, dated.strokes, shift, load, one.trust, outcome, message))
    return Table("Recordings in the order of the life", columns, tuple(rows))
