"""Rule by which faults fade, sample by sample: on line and in the exported C."""

from __future__ import annotations

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray, IntArray
from clutchid.observer.flags import FORGOTTEN, HEALED, N_FLAGS, Faults


@kernel
def gain_of(faults: Faults, gain: float) -> float:
    """Weight of the next sample in the shares: that of a mean, until it is the one of the memory."""
    faults.samples += 1.0
    if faults.samples * gain > 1.0:
        faults.samples = 1.0 / gain
    return 1.0 / faults.samples


@kernel
def fade(faults: Faults, flag: int, raised: bool, gain: float, weight: float, ended: bool) -> None:
    """Count a sample with or without a flag, which stands for `weight` samples of the share `gain` of the memory."""
    share = faults.share[flag] - gain * faults.share[flag]
    if raised:
        share = min(share + gain * weight, 1.0)
        faults.strokes[flag] = 0.0
    elif ended:
        faults.strokes[flag] = min(faults.strokes[flag] + 1.0, HEALED)
    faults.share[flag] = share if share > FORGOTTEN else 0.0
    if share > FORGOTTEN:
        faults.active = 1


@kernel
def recent(faults: Faults, flag: int, care: float) -> float:
    """Share of a flag as its limit of care counts it: of the last time, or, where that is 0, until strokes ended."""
    share: float = faults.share[flag]
    return share if care > 0.0 or faults.strokes[flag] < HEALED else 0.0


@kernel
def fade_all(faults: Faults, flags: IntArray, ended: IntArray, gain: float, weights: FloatArray) -> None:
    """Count the samples of a block with their flags (n,), and whether a stroke ends at each."""
    for i in range(flags.size):
        weight = gain_of(faults, gain)
        if flags[i] == 0 and faults.active == 0:
            continue
        faults.active = 0
        for flag in range(N_FLAGS):
            fade(faults, flag, (flags[i] >> flag) % 2 == 1, weight, weights[flag], ended[i] == 1)
