"""Turn a completed stroke or rest into a `Section`: its log, its label and its summary."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from clutchid.log import Log
from clutchid.signals.velocity import difference_velocity
from clutchid.strokes.bins import CLOSED
from clutchid.strokes.borders import Completed
from clutchid.strokes.manoeuvre import rest_label, stroke_label
from clutchid.strokes.section import Section, SectionSummary
from clutchid.strokes.stream import Samples

#: Half the number of bins over which a speed is computed: 20 ms before and after.
SPEED_BINS = 2


def section(part: Completed, name: str, metadata: Mapping[str, str]) -> Section:
    """The section of a completed stroke or rest; samples are copied so that the recording can be freed."""
    samples = part.samples
    columns = {column: values.copy() for column, values in samples.columns.items()}
    log = Log(samples.time.copy(), columns, name, metadata, edges=samples.edges)
    summary = _summary(part)
    if part.kind == "rest":
        label = rest_label(part.bins, long_hold=part.long_hold, missing=summary.missing)
    else:
        label = stroke_label(part.bins)
    departure = float(part.bins.time[min(part.lead, len(part.bins) - 1)])
    start, end = float(log.time[0]), float(log.time[-1])
    return Section(part.kind, label, log, start, end, departure, samples.first, summary)


def _summary(part: Completed) -> SectionSummary:
    samples, bins = part.samples, part.bins
    known = bins.position[np.isfinite(bins.position)]
    speed = difference_velocity(bins.time, bins.position, SPEED_BINS)
    supply, exhaust = (_pulses(samples, name) for name in ("duty_supply", "duty_exhaust"))
    pressure = samples.columns.get("pressure_a")
    finite = int(np.count_nonzero(np.isfinite(samples.columns["position"])))
    return SectionSummary(
        lowest=float(known.min()) if known.size else np.nan,
        highest=float(known.max()) if known.size else np.nan,
        level=float(bins.level[0]),
        reach=float(bins.reach[0]),
        opening_speed=float(np.nanmax(speed, initial=0.0)),
        closing_speed=float(np.nanmax(-speed, initial=0.0)),
        vented_rest=part.vented,
        supply_pulses=supply[0],
        exhaust_pulses=exhaust[0],
        duty_steps=supply[1] + exhaust[1],
        missing=1.0 - finite / len(samples),
        pressure=pressure is not None and bool(np.isfinite(pressure).any()),
    )


def _pulses(samples: Samples, name: str) -> tuple[int, int]:
    """Number of openings of a closed valve, and number of changes of its duty cycle."""
    duty = samples.columns.get(name)
    if duty is None:
        return 0, 0
    opened = duty > CLOSED
    pulses = int(opened[0]) + int(np.count_nonzero(opened[1:] & ~opened[:-1]))
    return pulses, int(np.count_nonzero(duty[1:] != duty[:-1]))
