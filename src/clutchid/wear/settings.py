"""Tuned numbers of the trend, and where they are from."""

from __future__ import annotations

from typing import NamedTuple


class Growth(NamedTuple):
    """Growth of a quantity: standard deviations of its first value, of its rate over a life, and of a jump.

    `walk` is the standard deviation of the rate's random walk over a life, as a share of `rate`.
    """

    start: float
    rate: float
    jump: float
    walk: float


#: Shift [m] and relative load: guesses from the virtual trucks' full range, 0 to 0.7 mm and 0 to 18 %; and wear of the
#: facing [m], where a calibration of load against wear is given. The walk was chosen on types 4 to 7 of both families,
#: so that forecasts hold (`benchmarks/wear_drawn.py`): shift and load go with wear along a curve, wear does not.
GROWTH = {
    "shift": Growth(0.5e-3, 0.7e-3, 0.5e-3, 0.4),
    "load": Growth(0.2, 0.2, 0.2, 0.4),
    "wear": Growth(4e-3, 6e-3, 4e-3, 0.25),
}

#: A life, in which the rate of a quantity may double or vanish: strokes, km, days; a facing of 3.5 mm in the virtual
#: fleet, as trucks in distribution traffic have.
LIFE = {"strokes": 1e6, "km": 4e5, "days": 1100.0, "recordings": 150.0}

#: Standard deviation of the scatter of wear over a life, as a share of the rate over a life. A guess.
SCATTER = 0.05


#: Air temperature in K that counts as that of the calibration where it had none.
REFERENCE = 293.15

#: Share of false alarms among recordings.
FALSE_ALARMS = 1e-3

#: Fall of the vented rest in m over a life of a clutch without an adjuster, whose rest falls by 6.3 times the wear of a
#: facing of 3.5 mm; and how many times faster than so far the rest may fall. Guesses on the generous side.
FALL, FASTER = 22e-3, 5.0

#: A jump that ends within this share of the former change from the new clutch is a replaced clutch.
AS_NEW = 0.4

#: Recordings in a row that read a leak, with a probability above the second: by chance alone at most `FALSE_ALARMS`.
LEAKS, LEAKING = 2, 1.0 - FALSE_ALARMS**0.5

#: A leak below this in m³/(Pa·s), 0.04 g/s at 5 bar, is that of seals that age: of virtual trucks 7e-12 after a life.
AGED = 1e-11

#: Recordings in a row that are farther from the calibration than a change explains.
DEPARTED = 3
