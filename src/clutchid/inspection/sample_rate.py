"""Sample rate against the model: steps of integration, and how much of the load curve passes between two samples."""

from __future__ import annotations

import math

import numpy as np

from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.reading import Reading
from clutchid.simulation.stiffness import MOST_SUBSTEPS, STABLE_STEP, TOP_SPEED

CHECK = "sample rate"

#: Samples that a stroke takes at least, and samples in the narrowest piece of the load curve.
A_STROKE, A_PIECE = 4, 1


def sample_rate(reading: Reading) -> Finding:
    """Whether a recording is fast enough for the model's stiffness and for the pieces of its load curve.

    Inputs are held between samples, so each edge of a valve is known to one sample only. At top speed the piston goes
    on by `TOP_SPEED` times that, and the load of one piece of the curve is taken for that of another.
    """
    step, p = reading.raster, reading.actuator.parameters
    if not math.isfinite(step):
        return Finding(CHECK, "-", "not tellable", "fewer than two samples have no rate.")
    steps = max(1, math.ceil(step * reading.rate / STABLE_STEP * (1 - 1e-9)))
    travel = TOP_SPEED * step
    narrowest = float(np.diff(reading.actuator.load.knots).min())
    verdict: Verdict = "good"
    if steps > MOST_SUBSTEPS or A_STROKE * travel > p.y_max:
        verdict = "bad"
    elif A_PIECE * travel > narrowest:
        verdict = "look"
    rate = f"{1 / step:.4g} Hz"
    repeated = "" if step < 1.5 * reading.step else f", repeated at {1 / reading.step:.4g} Hz"
    facts = (
        f"the fastest mode of the model is {reading.rate:.3g} 1/s ({steps} step{'' if steps == 1 else 's'} of "
        f"integration a sample), and at {TOP_SPEED:g} m/s the piston goes {travel * 1e3:.3g} mm between two samples"
    )
    needed = TOP_SPEED * A_PIECE / narrowest
    advice = {
        "good": "",
        "look": f", more than the narrowest piece of the load curve ({narrowest * 1e3:.3g} mm): edges of the valves "
        f"are known to a sample only, so a fit blurs the load and shifts it; record with {needed:.3g} Hz or more.",
        "bad": f", of a stroke of {p.y_max * 1e3:.3g} mm: fast strokes fall between the samples and a fit is wrong; "
        f"record with {needed:.3g} Hz or more.",
    }
    return Finding(CHECK, rate + repeated, verdict, f"at {rate}{repeated} {facts}{advice.get(verdict) or '.'}")
