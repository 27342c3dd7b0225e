"""The recursions of a lag of first order: the inner loops of `sensing`."""

from __future__ import annotations

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray


@kernel
def follow(x: FloatArray, lead: float, shares: tuple[float, float, float], shown: FloatArray) -> None:
    """What a sensor shows of the columns of x; `shares` are those of the last value shown, the last sample and this.

    At first it is `lead` samples of x's change behind.
    """
    decay, before, now = shares
    for c in range(x.shape[1]):
        shown[0, c] = x[0, c] - lead * (x[1, c] - x[0, c])
    for i in range(1, x.shape[0]):
        for c in range(x.shape[1]):
            shown[i, c] = decay * shown[i - 1, c] + before * x[i - 1, c] + now * x[i, c]


@kernel
def decayed(drive: FloatArray, decay: float) -> None:
    """Add to each value, in place, what is left of all before it."""
    for i in range(1, drive.size):
        drive[i] += decay * drive[i - 1]
