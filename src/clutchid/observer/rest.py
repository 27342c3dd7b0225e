"""The vented rest on line: where the sensor reads it, against the calibration, rest by rest."""

from __future__ import annotations

from typing import Annotated

from clutchid.codegen.records import Count
from clutchid.log import FloatArray

#: A vented rest lies below this position in m, whatever its sensor adds; above it is an excursion.
LOW = 3e-3

#: What was learnt is forgotten where the zero moves by more than this in m: 0.4 mm leave a load up to 12 % off. Smaller
#: shifts come with wear and warmth, drive by drive, and the filter follows them. See docs/derivations_online.md.
WRONG = 1e-4

#: Rests after a stroke that are remembered; their median is compared.
REMEMBERED = 8

#: So many rests after a stroke agree if they differ by no more than this in m. Where they are further than that from
#: those before, at least `EARLIER`, which agree too, the sensor has moved, and its stop with it; where the stop before
#: does not go with them, what was before is forgotten. Within a recording levels of nine trucks differ by 0.05 mm at
#: most.
AGREEING, EARLIER, APART = 3, 2, 1.5e-4

#: The piston has stopped where the halves of a still window differ by no more than this in m: else it creeps back, and
#: its level is none. No vented piston lies further below its stop than the other, whatever creeps. The noise of a
#: sensor moves a level by 6 µm. What other limits do: `python benchmarks/creeping.py`.
STOPPED, BELOW = 2e-5, 5e-5

#: Where a calibration has its rests after a stroke further above the stop than this in m, they are holds of the
#: position: friction holds the piston of all trucks of A, B and hybrids up to 0.57 mm above it, 40 % more of it
#: 0.72 mm.
HOLD = 8e-4


class Rest:
    """The vented rest between two samples.

    Attributes
    ----------
    shift : m
        How far it is taken to have moved since the calibration.
    lowest, returned : m
        Levels of the stretch: the lowest, NaN before there is one, and the last `n_returned` ones after a stroke.
    n_bin, n_medians
        Positions in the bin, and medians of bins in the still window, so far.
    vents
        Samples with an open exhaust valve since the piston came to rest.
    excursion, taken
        1 where the piston was away before, and where the level of the present rest has been taken.
    sorted
        Memory of a median.
    """

    shift: float
    lowest: float
    returned: Annotated[FloatArray, REMEMBERED]
    sorted: Annotated[FloatArray, REMEMBERED]
    n_returned: int
    n_bin: int
    n_medians: int
    vents: Count
    excursion: int
    taken: int


class RestBefore:
    """The vented rest of the calibration, and what a still window is.

    Attributes
    ----------
    exists, subtracted
        1 where the calibration has one, and where the position counts from it.
    lowest, returned, level : m
        Its levels, and half a 95 % interval of one.
    range : m
        Largest range of the medians of a still window.
    bin, bins, vents
        Samples in a bin, bins in a window, and samples of a vented rest.
    """

    exists: int
    subtracted: int
    lowest: float
    returned: float
    level: float
    range: float
    bin: int
    bins: int
    vents: Count
