"""A control unit: example of an application, test vectors, and what an exported observer costs on a Cortex-M4."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle, c_number
from clutchid.exports.outputs import OUTPUTS
from clutchid.log import FloatArray

COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"

#: Largest difference of an output, as a share of its largest value in the vectors: libm differs between compilers. In
#: float, standard deviations, innovations and speeds are less exact while the piston sticks (measured on truck A over
#: 60 s between a Cortex-M4 and x86-64: 8e-2, 2e-3 and 1e-3). Strokes and flags are equal.
TOLERANCE = {"float": 1e-3, "double": 1e-6}
LESS_EXACT = {"pressure_a_std": 300.0, "velocity": 10.0, "innovation": 20.0, "innovation_std": 20.0}

#: Clock of the mps2-an386 in Hz.
CLOCK = 25_000_000

#: Fixed spacing of the example's timer in us.
SPACING = 1000

#: Flags that save a fifth of the instructions: products are added without rounding, square roots need no call.
FAST = ("-ffp-contract=fast", "-fno-math-errno")

_CPU = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
_LINK = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-nostartfiles", "--specs=rdimon.specs")

#: 32 ns an instruction: a tick of the timer is 1.25 instructions, and 21 million instructions pass before it wraps.
_EMULATOR = (
    EMULATOR, "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=5",
    "-semihosting-config", "enable=on,target=native",
)  # fmt: skip
_LOOPS = 100_000


def example_files(style: CStyle) -> dict[str, str]:
    """An application and a test of the observer by their paths; the sources are in ``src/``.

    ``example/`` builds for this computer and for a Cortex-M4 with an FPU, ``test/`` compares the outputs with those of
    ``test/vectors.h``, see `vectors`.
    """
    values = {
        **_style_values(style),
        "spacing_us": SPACING,
        "clock_hz": CLOCK,
        "values": tuple(OUTPUTS),
        "fast": FAST,
    }
    names = {
        "example/main.c": "example.c",
        "example/Makefile": "example.mk",
        "example/startup.c": "startup.c",
        "example/linker.ld": "linker.ld",
        "test/test.c": "test.c",
        "test/Makefile": "test.mk",
    }
    return {path: template(f"{name}.j2", "clutchid.exports").render(values) for path, name in names.items()}


def _style_values(style: CStyle) -> dict[str, Any]:
    return {"name": style.name, "real": style.real, "two": style.rates == "two", "number": c_number(style.real)}


def vectors(samples: FloatArray, outputs: FloatArray, style: CStyle, begins_us: int = 0) -> str:
    """The header ``vectors.h``: samples, and the outputs that belong to them.

    Parameters
    ----------
    samples : (n, 5)
        Position in m, duty cycles of supply and exhaust, supply pressure in Pa, microseconds since the last sample.
    outputs : (n, 10)
        `OUTPUTS` after each sample.
    begins_us : us
        Time since a period of the valves' carrier began at the first sample.
    """
    number = c_number(style.real)
    inputs = [f"    {{{', '.join(map(number, row[:4]))}}}," for row in samples]
    rows = [f"    {{{', '.join([*map(number, row[:8]), *(f'{int(v)}u' for v in row[8:])])}}}," for row in outputs]
    values = {
        **_style_values(style),
        "inputs": "\n".join(inputs),
        "outputs": "\n".join(rows),
        "since_us": ", ".join(f"{int(row[4])}u" for row in samples),
        "tolerances": ", ".join(map(number, _tolerances(outputs, style))),
        "begins_us": begins_us,
    }
    text: str = template("vectors.h.j2", "clutchid.exports").render(values)
    return text


def _tolerances(outputs: FloatArray, style: CStyle) -> FloatArray:
    values = np.abs(np.where(np.isfinite(outputs), outputs, 0.0))
    largest = values.max(axis=0, initial=0.0)
    shares = [0.0 if name in ("strokes", "flags") else LESS_EXACT.get(name, 1.0) for name in OUTPUTS]
    tolerances: FloatArray = TOLERANCE[style.real] * np.array(shares) * largest
    return tolerances


@dataclass(frozen=True, slots=True)
class Count:
    """Instructions of a function over its calls: mean, and most."""

    mean: float
    most: int
    calls: int


@dataclass(frozen=True, slots=True)
class TargetCosts:
    """What an observer costs on a Cortex-M4 with an FPU: instructions, and memory in bytes.

    Parameters
    ----------
    fast, slow, load, start, store
        Instructions a call of each function; of NAME_slow only the calls that had work to do.
    millisecond
        Instructions a millisecond of NAME_fast and NAME_slow together.
    flash, flash_math
        Text, constants and initial values of the export as linked, and of what it takes from libm.
    ram, nvram
        NAME_t with input, output and band; NAME_nvram_t.
    stack_fast, stack_slow
        Of NAME_fast as an interrupt, and of the task below it.
    """

    fast: Count
    slow: Count
    load: Count
    start: Count
    store: Count
    millisecond: float
    flash: int
    flash_math: int
    ram: int
    nvram: int
    stack_fast: int
    stack_slow: int


def target_costs(
    folder: Path, style: CStyle, samples: FloatArray, begins_us: int = 0, flags: Sequence[str] = ("-O2", *FAST)
) -> TargetCosts | str:
    """Costs of the export in `folder` on an emulated Cortex-M4, or a sentence that says why they are not known.

    Parameters
    ----------
    samples : (n, 5)
        As for `vectors`.
    flags
        Of the compiler; by default those of the example's Makefile.
    """
    missing = [tool for tool in (COMPILER, EMULATOR) if shutil.which(tool) is None]
    if missing:
        return f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not installed: no costs were measured."
    with tempfile.TemporaryDirectory() as place:
        return _measured(Path(folder).resolve(), Path(place), style, samples, begins_us, tuple(flags))


def _measured(
    folder: Path, place: Path, style: CStyle, samples: FloatArray, begins_us: int, flags: tuple[str, ...]
) -> TargetCosts | str:
    for name in ("startup.c", "linker.ld"):
        (place / name).write_text(template(f"{name}.j2", "clutchid.exports").render(), encoding="utf-8")
    program = template("costs.c.j2", "clutchid.exports").render(
        _style_values(style) | {"begins_us": begins_us, "loops": _LOOPS}
    )
    (place / "costs.c").write_text(program, encoding="utf-8")
    (place / "samples.S").write_text(_SAMPLES, encoding="utf-8")
    (place / "samples.bin").write_bytes(_binary(samples, style))
    sources = [folder / "src" / f"{style.name}{part}.c" for part in ("", "_data", "_filter", "_model")]
    objects = [f"{source.stem}.o" for source in sources]
    for source, name in zip(sources, objects, strict=True):
        failure = _run([COMPILER, *_CPU, "-std=c99", *flags, *_LINK[:2], "-c", "-o", name, str(source)], place)
        if isinstance(failure, str):
            return failure
    link = [COMPILER, *_CPU, "-std=gnu99", "-O2", *_LINK, "-T", "linker.ld", "-Wl,-Map=costs.map", f"-I{folder}/src"]
    built = _run([*link, "-o", "costs.elf", "costs.c", "startup.c", "samples.S", *objects, "-lm"], place)
    if isinstance(built, str):
        return built
    run = _run([*_EMULATOR, "-kernel", "costs.elf"], place)
    if isinstance(run, str):
        return run
    found = {name: int(value) for name, value in (line.split() for line in run.stdout.splitlines())}
    return _costs(found, (place / "costs.map").read_text(encoding="utf-8"), objects)


_SAMPLES = """    .syntax unified
    .section .rodata.samples, "a"
    .balign 8
    .global samples_begin
    .global samples_end
samples_begin:
    .incbin "samples.bin"
samples_end:
"""


def _binary(samples: FloatArray, style: CStyle) -> bytes:
    real = np.dtype("<f4" if style.real == "float" else "<f8")
    record = np.dtype([("values", real, 4), ("since_us", "<u4")], align=True)
    rows = np.zeros(len(samples), record)
    rows["values"], rows["since_us"] = samples[:, :4], samples[:, 4]
    return rows.tobytes()


def _run(command: Sequence[str], place: Path) -> subprocess.CompletedProcess[str] | str:
    try:
        done = subprocess.run(
            command, cwd=place, capture_output=True, encoding="utf-8", errors="replace", timeout=600, check=False
        )
    except subprocess.TimeoutExpired:
        return f"{command[0]} took more than 600 s: no costs were measured."
    if done.returncode:
        return f"{command[0]} failed, so no costs were measured: {(done.stderr or done.stdout).strip()[:2000]}"
    return done


def _costs(found: dict[str, int], linker_map: str, objects: Sequence[str]) -> TargetCosts:
    a_tick = 2 * _LOOPS / found["loop"]

    def total(name: str) -> float:
        return a_tick * (found[f"{name}_sum_high"] * 2**24 + found[f"{name}_sum_low"])

    def count(name: str) -> Count:
        calls = found[f"{name}_calls"]
        return Count(total(name) / max(calls, 1), round(a_tick * found[f"{name}_most"]), calls)

    return TargetCosts(
        fast=count("fast"),
        slow=count("slow"),
        load=count("load"),
        start=count("start"),
        store=count("store"),
        millisecond=(total("fast") + total("slow")) / max(found["milliseconds"], 1),
        flash=sum(_flash(linker_map, re.escape(name)) for name in objects),
        flash_math=_flash(linker_map, r"\S*/libm\.a\(\S+\)"),
        ram=found["memory"] + found["buffers"],
        nvram=found["nvram"],
        stack_fast=found["stack_fast"],
        stack_slow=found["stack_slow"],
    )


def _flash(linker_map: str, owner: str) -> int:
    """Bytes of the sections of an object that lie in flash; a map lists them after those that were left out."""
    _, _, kept = linker_map.partition("Linker script and memory map")
    sections = rf"^ \.(?:text|rodata|data)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+) {owner}$"
    return sum(int(size, 16) for size in re.findall(sections, kept, re.MULTILINE))
