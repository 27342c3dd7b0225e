"""Rule that counts strokes, sample by sample: for recordings, on line and in the exported C."""

from __future__ import annotations

from clutchid.codegen.kernels import kernel
from clutchid.codegen.records import Count
from clutchid.strokes.stroke import BEGINS, ENDS, LONGEST_US, SHORTEST, Stroke


@kernel
def later(us: Count, dt: Count) -> Count:
    """A time in us after `dt` us more, at most the longest one."""
    return us + dt if LONGEST_US - us > dt else LONGEST_US


@kernel
def count_stroke(stroke: Stroke, position: float, dt: Count) -> bool:
    """Whether a stroke ends at a position in m from the vented rest, NaN for none, `dt` us after the last one."""
    if stroke.within == 1:
        stroke.lasted = later(stroke.lasted, dt)
    if position > BEGINS and stroke.within == 0:
        stroke.within, stroke.lasted = 1, 0
    elif position < ENDS and stroke.within == 1:
        stroke.within = 0
        return bool(stroke.lasted >= SHORTEST)
    return False
