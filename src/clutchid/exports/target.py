"""A control unit: example of an application, and test vectors."""

from __future__ import annotations

import numpy as np

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle
from clutchid.exports.misra import CHECKER
from clutchid.exports.outputs import OUTPUTS
from clutchid.log import FloatArray

#: Largest difference of an output, as a share of its largest value in the vectors: libm differs between compilers. In
#: float, standard deviations, innovations and speeds are less exact while the piston sticks (measured on truck A over
#: 60 s between a Cortex-M4 and x86-64: 8e-2, 2e-3 and 1e-3). Strokes and flags are equal.
TOLERANCE = {"float": 1e-3, "double": 1e-6}
_LESS_EXACT = {"pressure_a_std": 300.0, "velocity": 10.0, "innovation": 20.0, "innovation_std": 20.0}

#: Clock of the mps2-an386 in Hz.
_CLOCK = 25_000_000

#: Fixed spacing of the example's timer in us.
SPACING = 1000

#: Flags that save a fifth of the instructions: products are added without rounding, square roots need no call.
FAST_FLAGS = ("-ffp-contract=fast", "-fno-math-errno")

#: Flag of NAME.c, whose own work is little: it saves 2 kB of flash and adds 20 instructions a sample
#: (``python benchmarks/export.py --costs``).
SMALL = "-Os"


def example_files(style: CStyle) -> dict[str, str]:
    """An application and a test of the observer by their paths; the sources are in ``src/``.

    ``example/`` builds for this computer and for a Cortex-M4 with an FPU, ``test/`` compares the outputs with those of
    ``test/vectors.h``, see `vectors`.
    """
    values = {
        **style.values, "spacing_us": SPACING, "clock_hz": _CLOCK, "values": OUTPUTS, "fast": FAST_FLAGS,
        "small": SMALL, "checker": CHECKER[1],
    }  # fmt: skip
    names = {
        "example/main.c": "example.c",
        "example/Makefile": "example.mk",
        "example/startup.c": "startup.c",
        "example/linker.ld": "linker.ld",
        "test/test.c": "test.c",
        "test/Makefile": "test.mk",
    }
    return {path: template(f"{name}.j2", "clutchid.exports").render(values) for path, name in names.items()}


def vectors(samples: FloatArray, outputs: FloatArray, style: CStyle, begins_us: int = 0) -> str:
    """The header ``vectors.h``: samples, and the outputs that belong to them.

    Parameters
    ----------
    samples : (n, 6)
        As `parity.samples_of` has them; they have no temperature of the air.
    outputs : (n, outputs)
        `OUTPUTS` after each sample.
    begins_us : us
        Time since a period of the valves' carrier began at the first sample.
    """
    values = {
        **style.values,
        "samples": samples.tolist(),
        "outputs": [dict(zip(OUTPUTS, row, strict=True)) for row in outputs.tolist()],
        "units": OUTPUTS,
        "tolerances": _tolerances(outputs, style).tolist(),
        "begins_us": begins_us,
    }
    return template("vectors.h.j2", "clutchid.exports").render(values)


def _tolerances(outputs: FloatArray, style: CStyle) -> FloatArray:
    values = np.abs(np.where(np.isfinite(outputs), outputs, 0.0))
    largest = values.max(axis=0, initial=0.0)
    shares = [_LESS_EXACT.get(name, 1.0) if output.unit else 0.0 for name, output in OUTPUTS.items()]
    tolerances: FloatArray = TOLERANCE[style.real] * np.array(shares) * largest
    return tolerances
