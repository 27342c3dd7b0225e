"""A stroke of the piston: where it begins and ends, and its shortest time.

This is the only definition of a stroke: recordings, the observer and the exported C count by it, and what a clutch
wears in a stroke is added where one has been counted.
"""

from __future__ import annotations

from clutchid.codegen.records import Count

#: A stroke begins where the position in m, from the vented rest, rises above the first and ends where it falls below
#: the second, so that noise does not count.
BEGINS, ENDS = 2e-3, 1.5e-3

#: Resolution in s of the clock of a control unit, and the longest time that it counts. A shorter stroke in us is a
#: spike of the sensor.
RESOLUTION, LONGEST_US, SHORTEST = 1e-6, 0xFFFFFFFF, 20_000

#: A full stroke reaches this share of the way to the far stop, in this time in s at least.
FULL, QUICKEST = 0.8, 0.1


class Stroke:
    """A stroke that goes on: 1 within one, and its time so far in us."""

    within: int
    lasted: Count
