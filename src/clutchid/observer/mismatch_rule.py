"""Rule for the ratio of the innovations to those of the calibration: on line and in the exported C."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.codegen.records import Count
from clutchid.log import FloatArray
from clutchid.observer.flags import HEALED, SIGNAL_FAULTS
from clutchid.observer.mismatch import MEMORY, Mismatch


@kernel
def normalised_square(innovation: float, variance: float, outlier: float) -> float:
    """Innovation squared over its variance; an outlier counts as one at the gate."""
    return min(innovation * innovation / variance, outlier * outlier)


@kernel
def count_innovation(mismatch: Mismatch, square: float, usual: float) -> None:
    """Count the normalised square of a correction in motion."""
    ratio = square / usual
    mismatch.running += (1.0 / MEMORY) * (ratio - mismatch.running)
    mismatch.sound += (1.0 / MEMORY) * (ratio - mismatch.sound)


@kernel
def note_faults(mismatch: Mismatch, flags: Count) -> None:
    """Note that a sample of the present stroke has a fault of the signals, by its flags."""
    if flags & SIGNAL_FAULTS > 0:
        mismatch.faulty = 1


@kernel
def end_of_stroke(mismatch: Mismatch) -> None:
    """Keep the mean of strokes without a fault; some of them after one it is the mean again."""
    if mismatch.faulty == 1:
        mismatch.sound, mismatch.strokes = mismatch.stored, 0.0
    else:
        mismatch.stored = mismatch.sound
        mismatch.strokes = min(mismatch.strokes + 1.0, HEALED)
        if mismatch.strokes >= HEALED:
            mismatch.running = mismatch.sound
    mismatch.faulty = 0


@kernel
def normalised_squares(
    innovations: FloatArray, velocities: FloatArray, least_speed: float, outlier: float, squares: FloatArray
) -> None:
    """Normalised squares (n,) of corrections in motion, NaN elsewhere, of innovations with their variance (n, 2)."""
    for i in range(squares.size):
        moving = abs(velocities[i]) > least_speed and math.isfinite(innovations[i, 0])
        squares[i] = normalised_square(innovations[i, 0], innovations[i, 1], outlier) if moving else math.nan


@kernel
def count_innovations(mismatch: Mismatch, squares: FloatArray, usual: float, means: FloatArray) -> None:
    """Count normalised squares (n,), NaN for none; the mean after each, NaN where it does not move."""
    for i in range(squares.size):
        if math.isfinite(squares[i]):
            count_innovation(mismatch, squares[i], usual)
            means[i] = mismatch.running
