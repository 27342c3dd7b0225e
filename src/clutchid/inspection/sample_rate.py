"""Sample rate: integration steps of the model per sample, and travel along the load curve between two samples."""

from __future__ import annotations

import math

import numpy as np

from clutchid.inspection.check import Check, Grade
from clutchid.inspection.reading import Reading
from clutchid.signals.duty_cycle import CONTINUOUS_STEP
from clutchid.simulation.stiffness import MOST_SUBSTEPS, STABLE_STEP, TOP_SPEED

CHECK = "sample rate"

#: Least number of samples per stroke, and in the narrowest knot interval of the load curve.
PER_STROKE, PER_INTERVAL = 4, 1

#: Sample rate in Hz at which all changes of duty cycles are recorded, see `clutchid.signals.duty_cycle.is_slow`.
LEAST_RATE = 1000.0

#: Interval in s from which milliseconds were probably read as seconds, and below which seconds as something smaller.
_SLOW, _FASTEST = 0.5, 5e-6


def sample_rate(reading: Reading) -> Check:
    """Whether the sample rate suits the stiffness of the model and the knot intervals of its load curve.

    Inputs are held between samples, so a valve edge is known to one sample only. At top speed the piston travels
    `TOP_SPEED` times that time, and the load of one knot interval is attributed to another.
    """
    step, p = reading.update_interval, reading.actuator.parameters
    if not math.isfinite(step):
        return Check(CHECK, "-", "undetermined", "a sample rate needs at least two samples.")
    steps = max(1, math.ceil(step * reading.rate / STABLE_STEP * (1 - 1e-9)))
    travel = TOP_SPEED * step
    narrowest = float(np.diff(reading.actuator.load.knots).min())
    if reason := _implausible(reading, steps, slow=PER_STROKE * travel > p.y_max):
        return Check(CHECK, f"{1 / step:.4g} Hz", "bad", f"at {1 / step:.4g} Hz {reason}")
    grade: Grade = "good"
    if PER_STROKE * travel > p.y_max:
        grade = "bad"
    elif PER_INTERVAL * travel > narrowest or step > CONTINUOUS_STEP:
        grade = "suspect"
    rate = f"{1 / step:.4g} Hz"
    repeated = "" if step < 1.5 * reading.step else f", repeated at {1 / reading.step:.4g} Hz"
    facts = (
        f"the fastest mode of the model is {reading.rate:.3g} 1/s ({steps} integration step{'' if steps == 1 else 's'} "
        f"per sample), and at {TOP_SPEED:g} m/s the piston travels {travel * 1e3:.3g} mm between two samples"
    )
    needed = max(TOP_SPEED * PER_INTERVAL / narrowest, LEAST_RATE)
    unit = ", or write the unit of the time as ms if the stamps count milliseconds" if step >= _SLOW else ""
    knots = f", more than the narrowest knot interval of the load curve ({narrowest * 1e3:.3g} mm)"
    advice = {
        "good": "",
        "suspect": f"{knots if PER_INTERVAL * travel > narrowest else ''}: the valves open and close between the "
        "samples, at times that are not recorded, so that a load is smoothed and shifted, and its trust 'with care' at "
        f"best; record at {needed:.4g} Hz or more.",
        "bad": f" of a stroke of {p.y_max * 1e3:.3g} mm: fast strokes have too few samples and a fit would be wrong; "
        f"record at {needed:.4g} Hz or more{unit}.",
    }
    return Check(CHECK, rate + repeated, grade, f"at {rate}{repeated} {facts}{advice.get(grade) or '.'}")


def _implausible(reading: Reading, steps: int, *, slow: bool) -> str:
    """Why the rate cannot be that of a recording of this actuator, if that is not for its being too `slow`."""
    if reading.update_interval < _FASTEST:
        return (
            "no sensor of a position is that fast: the stamps seem to be in s or ms and are read as smaller; correct "
            "the unit of the time."
        )
    if steps > MOST_SUBSTEPS and not slow:
        return (
            f"the model is too stiff ({reading.rate:.3g} 1/s); check the mass, the volumes and the stiffnesses of the "
            "parameters."
        )
    return ""
