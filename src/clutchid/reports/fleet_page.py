"""Page of a fleet: distribution of wear, the worst and the odd vehicles, failures by reason, and all vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from os import PathLike

import numpy as np

from clutchid.recordings.files import write_text
from clutchid.reports.figures import svg
from clutchid.reports.fleet_figures import distribution_figure
from clutchid.reports.fleet_odd import MARKS, ODD_AT_LEAST, ODD_SCORE, Odd, odd_vehicles
from clutchid.reports.fleet_tables import all_table, odd_tables, reasons_table, types_table, worst_table
from clutchid.reports.fleet_values import (
    Reason,
    Spans,
    VehicleRow,
    has_reading,
    quantiles,
    quantity_of,
    spans_of,
)
from clutchid.reports.html import Block, Notice, Page, Picture, Section, Sortable, Text, escape, render
from clutchid.reports.provenance import provenance
from clutchid.reports.style import MM

#: Vehicles below which the range of all is said in place of that of nine in ten.
FEW = 20

__all__ = ["Reason", "VehicleRow", "fleet_page", "page_of"]


def fleet_page(
    vehicles: Sequence[VehicleRow], reasons: Sequence[Reason], command: str, path: str | PathLike[str]
) -> None:
    """Write the page of a fleet as one self-contained HTML file, which leads to the pages of its vehicles.

    Parameters
    ----------
    command
        The command line that repeats the run, shown on the page.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    write_text(render(page_of(vehicles, reasons, command)), path)


def page_of(vehicles: Sequence[VehicleRow], reasons: Sequence[Reason], command: str) -> Page:
    """The page before it is rendered."""
    spans = spans_of(vehicles)
    odd = odd_vehicles(vehicles, spans)
    known = any(map(has_reading, vehicles))
    sections = [Section("Wear", _wear(vehicles, spans))]
    if known:
        limited = any(not np.isnan(one.left) for one in vehicles)
        heading = "Soonest at their limit" if limited else "Most worn"
        sections.append(Section(heading, (worst_table(vehicles, spans),)))
    sections.append(Section("Odd vehicles", _odd(odd)))
    sections.append(Section("Recordings that do not count", _failures(reasons)))
    if vehicles:
        sections.append(Section("All vehicles", (Sortable(all_table(vehicles, odd, spans)),)))
    return Page("Wear of a fleet", _subtitle(vehicles), tuple(sections), provenance([], command))


def _subtitle(vehicles: Sequence[VehicleRow]) -> str:
    statuses: Counter[str] = Counter()
    for one in vehicles:
        statuses.update(one.statuses)
    recordings = sum(one.recordings for one in vehicles)
    by_status = ", ".join(f"{number:,} {status}" for status, number in statuses.most_common() if number)
    words = f"{_number(len(vehicles), 'vehicle')}, {_number(recordings, 'recording')}"
    return f"{words}: {by_status}" if by_status else words


def _wear(vehicles: Sequence[VehicleRow], spans: Spans) -> tuple[Block, ...]:
    known = [one for one in vehicles if has_reading(one)]
    if not known:
        return (Notice("No recording determines the wear of a vehicle.", "failed"),)
    words = f"{len(known):,} of {_number(len(vehicles), 'vehicle')} have readings of the clutch. {_spread(known)}"
    what = "their wear" if quantity_of(known) == "wear" else "the shift of their half-load position"
    more = " and by what is left until their limit" if any(np.isfinite(one.left) for one in vehicles) else ""
    caption = f"Vehicles by {what} now{more}. In all figures and tables, changes are since the calibration of the type."
    picture = Picture(svg(distribution_figure(vehicles, spans)), caption, "Histograms of wear and of what is left")
    return Text(escape(words)), picture, types_table(vehicles, spans)


def _spread(known: Sequence[VehicleRow]) -> str:
    """The median and the range of nine vehicles in ten; of all where there are few, and of two that only."""
    name = quantity_of(known)
    few = len(known) < FEW
    shares = (0.0, 0.5, 1.0) if few else (0.05, 0.5, 0.95)
    low, median, high = (
        f"{value / MM:.3f}".replace("-", "−")
        for value in quantiles([getattr(one, name) for one in known], shares)
        if value is not None
    )
    if len(known) < 3:
        return f"Their {name} is {low} and {high} mm." if len(known) == 2 else f"Its {name} is {median} mm."
    return f"The median {name} is {median} mm; {'all' if few else 'nine of ten'} are between {low} and {high} mm."


def _odd(odd: Sequence[Odd]) -> tuple[Block, ...]:
    if not odd:
        return (Notice("No vehicle stands out.", "ok"),)
    counts = Counter(one.mark for one in odd)
    links = ", ".join(
        f'<a href="#filter={mark.replace(" ", "+")}">{mark}</a> ({counts[mark]:,})' for mark in MARKS if counts[mark]
    )
    rule = (
        f"A rate is fast or slow where its robust z score among at least {ODD_AT_LEAST} vehicles of the type, from "
        f"their median and median absolute deviation, is beyond {ODD_SCORE}."
    )
    return Text(f"All of them, in the table of all vehicles: {links}. {rule}"), *odd_tables(odd)


def _failures(reasons: Sequence[Reason]) -> tuple[Block, ...]:
    return (reasons_table(reasons),) if reasons else (Notice("Every recording counts.", "ok"),)


def _number(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
