"""A fleet as a document: what is due, replacements, alarms, types, failures by reason, all vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from clutchid.documents.document import Chapter, Document, LabelRow, Notice, Sortable
from clutchid.documents.fleet_tables import (
    Spans,
    VehicleRow,
    alarms_table,
    all_table,
    due_table,
    expected_due,
    has_reading,
    months_table,
    quantiles,
    quantity_of,
    reasons_table,
    spans_of,
    tag_tables,
    types_table,
)
from clutchid.documents.results import FleetWear
from clutchid.documents.style import MM

#: Vehicles below which the range of all is said in place of that of nine in ten.
_FEW = 20


def fleet_document(fleet: FleetWear, command: str = "") -> Document:
    """Document of a fleet, whose page leads to those of its vehicles."""
    vehicles = fleet.vehicles
    measured = [vehicle for vehicle in vehicles if has_reading(vehicle)]
    return Document(
        "Wear of a fleet", _subtitle(vehicles), tuple(_rows(vehicles, measured)) if measured else (),
        notices=() if measured else (Notice("No recording determines the wear of a vehicle.", "none"),),
        sections=lambda: _sections(fleet, spans_of(vehicles)),
        command=command,
    )  # fmt: skip


def _rows(vehicles: Sequence[VehicleRow], measured: Sequence[VehicleRow]) -> Iterator[LabelRow]:
    """How many clutches are due, how many alarms there are, and the wear in short."""
    if due := expected_due(vehicles):
        sums = ", ".join(f"{number:,.1f} within {words}" for words, number in due)
        yield LabelRow("due", f"Clutches that are expected to reach their limit: {sums} from their last recordings on.")
    alarmed = [len(vehicle.alarms) for vehicle in vehicles if vehicle.alarms]
    yield LabelRow(
        "alarms", f"{_number(sum(alarmed), 'alarm')} of {_number(len(alarmed), 'vehicle')}" if alarmed else "none"
    )
    counted = f"{len(measured):,} of {_number(len(vehicles), 'vehicle')} have readings of the clutch"
    yield LabelRow("wear", f"{counted}. {_spread(measured)}")


def _sections(fleet: FleetWear, spans: Spans) -> list[Chapter]:
    vehicles = fleet.vehicles
    failures = reasons_table(fleet.reasons) if fleet.reasons else Notice("Every recording counts.", "good")
    sections = []
    if any(map(has_reading, vehicles)):
        limited = any(not np.isnan(vehicle.left.value) for vehicle in vehicles)
        sections.append(Chapter("Due first" if limited else "Most worn", (due_table(vehicles, spans),)))
    if any(row.by_month for row in vehicles):
        rows = fleet.replacements
        sections.append(Chapter("Replacements", (months_table(rows), *tag_tables(rows))))
    alarms = alarms_table(vehicles) if any(row.alarms for row in vehicles) else Notice("No alarm.", "good")
    sections.append(Chapter("Alarms", (alarms,)))
    if any(map(has_reading, vehicles)):
        sections.append(Chapter("Types", (types_table(vehicles, spans),)))
    sections.append(Chapter("Recordings that do not count", (failures,)))
    if vehicles:
        sections.append(Chapter("All vehicles", (Sortable(all_table(vehicles, spans)),)))
    return sections


def _subtitle(vehicles: Sequence[VehicleRow]) -> str:
    statuses: Counter[str] = Counter()
    for vehicle in vehicles:
        statuses.update(vehicle.statuses)
    recordings = sum(vehicle.recordings for vehicle in vehicles)
    by_status = ", ".join(
        f"{number:,} {status.replace('_', ' ')}" for status, number in statuses.most_common() if number
    )
    words = f"{_number(len(vehicles), 'vehicle')}, {_number(recordings, 'recording')}"
    return f"{words}: {by_status}" if by_status else words


def _spread(vehicles: Sequence[VehicleRow]) -> str:
    """The median and the range of nine vehicles in ten; of all where there are few, and of two that only."""
    name = quantity_of(vehicles)
    few = len(vehicles) < _FEW
    shares = (0.0, 0.5, 1.0) if few else (0.05, 0.5, 0.95)
    low, median, high = (
        f"{value / MM:.3f}".replace("-", "−")
        for value in quantiles([getattr(vehicle, name).value for vehicle in vehicles], shares)
        if value is not None
    )
    if len(vehicles) < 3:
        return f"Their {name} is {low} and {high} mm." if len(vehicles) == 2 else f"Its {name} is {median} mm."
    return f"The median {name} is {median} mm; {'all' if few else 'nine of ten'} are between {low} and {high} mm."


def _number(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
