"""The exported observer in C: against the one in Python on calibrated trucks, and its costs on a Cortex-M4F.

    python benchmarks/export.py [--trucks 24 | --numbers 3,5] [--families A,B] [--seconds 60] [--change warm]
        [--seed 2] [--wear 2]
    python benchmarks/export.py --costs [--method joint] [--calibration CAL.toml --log WORN.csv]
    python benchmarks/export.py --prove A0,B1,h:3 --calibrations FOLDER

Each truck is calibrated on 30 s with pressure and the conditions; then a clutch worn by 2 mm is followed from position
alone by Python and by the C: in double, in float, and in float with two rates, of which the slow task runs after every
sample. Theta is in prior standard deviations, the load in % of its peak, the pressure in Pa rms and, rms too, as a
share of its standard deviation. Beside them the C in double, given a position with noise of 10 nm.

Costs are those in float of truck 0 of family A over 10 s of the worn clutch, or of a calibration and a recording:
counted by an emulator (`arm-none-eabi-gcc`, `qemu-system-arm -icount`), in instructions, not cycles, not on hardware;
beside them a bound by the loops of the C, see `instructions.py`.

`--prove` writes the default export of calibrated trucks in float and in double, and runs its own tests, `make -C test`
and `make -C test arm`. A line has what they print, and parity as the export says it.
"""

from __future__ import annotations

import argparse
import math
import re
import subprocess
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import jinja2
import numpy as np
from instructions import program
from online import calibrated

import clutchid
from clutchid.exports.c99 import CStyle, compiler, observer_c99, source_files
from clutchid.exports.data import size_of
from clutchid.exports.filter import correction_shares
from clutchid.exports.parity import begins_us, begun, parity, replay, samples_of
from clutchid.exports.target import FAST_FLAGS, SMALL, example_files
from clutchid.log import FloatArray, Log
from clutchid.observer import observer, start
from clutchid.observer.configuration import Observer
from clutchid.observer.inputs import window_size
from clutchid.observer.methods import METHODS
from clutchid.observer.rest import REMEMBERED
from clutchid.truck import CHANGES, drive, truck

STYLES = {
    "double": CStyle(real="double"),
    "float": CStyle(real="float"),
    "float, two rates": CStyle(real="float", rates="two"),
}

#: Samples whose costs are counted, at most.
COSTED = 10_000

_COMPILER = ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
_LINK = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-nostartfiles", "--specs=rdimon.specs")

#: 32 ns an instruction: a tick of the timer is 1.25 instructions, and 21 million instructions pass before it wraps.
_EMULATOR = (
    "qemu-system-arm", "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=5",
    "-semihosting-config", "enable=on,target=native",
)  # fmt: skip
_LOOPS = 100_000

_SAMPLES = """    .syntax unified
    .section .rodata.samples, "a"
    .balign 8
    .global samples_begin
    .global samples_end
samples_begin:
    .incbin "samples.bin"
samples_end:
"""


#: Standard deviation in m of noise on the position that the C in double is given, in a row of its own.
NOISE, ROW = 1e-8, "double, 10 nm"


def worn_truck(
    family: str, number: int, seconds: float, change: Sequence[str] = (), seed: int = 2, wear: float = 2e-3
) -> tuple[clutchid.ParameterFile, Log]:
    """A truck's calibration, and a recording of its worn clutch."""
    kind = truck(number, family)
    fit = clutchid.calibrate(drive(kind, seconds=30.0, seed=1, conditions=True).log)
    worn = drive(kind, seconds=seconds, seed=seed, wear=wear, conditions=True, pressure=False, change=change)
    return clutchid.parameter_file(fit), worn.log.without("temperature_ambient")


def compared(content: clutchid.ParameterFile, log: Log) -> dict[str, tuple[float, float, float, float, bool]]:
    """Theta, load, pressure, its share, and whether all flags and strokes are alike, by style."""
    followed = observer(content.actuator, "joint", calibration=content.calibration)
    state, rows = begun(followed, start(followed)), {}
    noise = NOISE * np.random.default_rng(0).standard_normal(len(log))
    noisy = log.with_columns(position=log.columns["position"] + noise)
    for name, style, record in [*((*item, log) for item in STYLES.items()), (ROW, STYLES["double"], noisy)]:
        in_c = replay(followed, observer_c99(followed, state, style, "benchmark"), style, record, compiler())
        got = parity(followed, state, log, in_c)
        alike = not got.flags and got.strokes[0] == got.strokes[1]
        rows[name] = got.theta, 100.0 * got.load, got.pressure, got.pressure_share, alike
    return rows


class Count(NamedTuple):
    """Instructions of a function over its calls: mean, and most."""

    mean: float
    most: int
    calls: int


class Costs(NamedTuple):
    """Instructions of each function and a millisecond, and bytes of memory: flash, that of libm, RAM, NVRAM, stacks."""

    counts: dict[str, Count]
    millisecond: float
    memory: dict[str, int]


def target_costs(observed: Observer, style: CStyle, log: Log, flags: Sequence[str] = ("-O2", *FAST_FLAGS)) -> Costs:
    """Costs of an observer as calibrated on an emulated Cortex-M4F, over a recording."""
    modules = observer_c99(observed, start(observed), style, "costs")
    values = {"name": style.name, "real": style.real, "two": style.rates == "two", "loops": _LOOPS}
    program = jinja2.Template((Path(__file__).parent / "costs.c.j2").read_text("utf-8"), trim_blocks=True)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files = source_files(modules) | {Path(path).name: text for path, text in example_files(style).items()}
        files["costs.c"] = program.render(values | {"begins_us": begins_us(log)})
        for name, text in (files | {"samples.S": _SAMPLES}).items():
            (folder / name).write_text(text, encoding="utf-8")
        (folder / "samples.bin").write_bytes(_binary(samples_of(log)[:COSTED], style))
        objects = [f"{stem}.o" for stem in modules]
        for stem, target in zip(modules, objects, strict=True):
            own = (*flags, SMALL) if stem == style.name else flags
            _run([*_COMPILER, "-std=c99", *own, *_LINK[:2], "-c", "-o", target, f"{stem}.c"], folder)
        link = [*_COMPILER, "-std=gnu99", "-O2", *_LINK, "-T", "linker.ld", "-Wl,-Map=costs.map", "-o", "costs.elf"]
        _run([*link, "costs.c", "startup.c", "samples.S", *objects, "-lm"], folder)
        printed = _run([*_EMULATOR, "-kernel", "costs.elf"], folder)
        numbers = {name: int(value) for name, value in (line.split() for line in printed.splitlines())}
        return _costs(numbers, (folder / "costs.map").read_text(encoding="utf-8"), objects)


class Bound(NamedTuple):
    """Bounds of the instructions of a sample in time, of one 5 ms late, of a slow task and a load; steps a sample."""

    usual: float
    late: float
    slow: float
    load: float
    steps: int


#: Interval in us of a sample that is late.
LATE = 5000


def bounds(observed: Observer, style: CStyle) -> Bound:
    """Bounds by the loops of an export; without what a new calibration or a divergence adds to one sample."""
    n, joint, size = style.name, observed.joint, size_of(observed.joint)
    pieces = observed.joint.free.pieces
    numbers = {
        "memory->segment": 0, "table->n": size.pieces - 1, "basis->n": size.window, "reach[0]": 0,
        "reach[1]": int((pieces[:, 1] - pieces[:, 0]).max()), "self->refresh_due": 0, "self->reset_due": 0,
        "work->of->drift": 0, "data->leak": size.parameters - 1, "rest->n_returned": 8,
    }  # fmt: skip
    kinds = {"belief": "filter_belief", "derived": "filter_derived", "constants": "model_constants"}
    copied = {f"self->{name}[]": f"{n}_{kind}_t" for name, kind in kinds.items()}
    copied |= {
        "of->at": f"{n}_filter_motion_t",
        "self->sound": f"{n}_filter_belief_t",
        "*derived": f"{n}_filter_derived_t",
    }
    c = program(source_files(observer_c99(observed, start(observed), style, "bound")), numbers, copied)
    most, spacing, every = float(joint.pace[2].max()), joint.settings.spacing, joint.settings.every
    steps, late = math.ceil(spacing * most), math.ceil(1e-6 * LATE * most)
    window = window_size(spacing)
    lengths = {"before->bin": window.bin, "before->bins": window.bins, "rest->n_returned": REMEMBERED}
    c = c.with_values(known={"self->n_past": c.constants[f"{n}_n_past"], **lengths}, turns={"correct": 0})
    items = [
        c.with_values(known={"self->item": i, "of->item": i - 1}).call("work").cost
        for i in range(c.constants["n_items"])
    ]
    ends = [0, *correction_shares(size, every)]
    slices = [sum(items[a:b]) for a, b in pairwise(ends)] if style.rates == "one" else [0.0]

    def sample(since_us: int, of_move: int, alone: int) -> float:
        follows = c.with_values(
            turns={"move": of_move, "move_alone": alone}, known={"intake->pending": 0, "intake->sampled": 1}
        )
        return follows.call(f"{n}_fast", (None, None, None, since_us, None)).cost + max(slices)

    usual = sample(round(1e6 * spacing), steps, 0)
    return Bound(usual, sample(LATE, 1, late), sum(items), c.call(f"{n}_load").cost, steps)


def with_late(log: Log, lost: int = LATE // 1000 - 1, every: int = 40) -> Log:
    """A recording of which, once in `every` samples, at a drawn place, so many are lost."""
    draws, there = np.random.default_rng(0), np.ones(len(log), dtype=bool)
    for begin in range(50, len(log) - 60, every):
        at = begin + int(draws.integers(0, every - 25))
        there[at : at + lost] = False
    rows = np.flatnonzero(there)
    return Log(log.time[rows], {name: values[rows] for name, values in log.columns.items()}, log.name, log.metadata)


def _binary(samples: FloatArray, style: CStyle) -> bytes:
    real = np.dtype("<f4" if style.real == "float" else "<f8")
    record = np.dtype([("values", real, 4), ("since_us", "<u4")], align=True)
    rows = np.zeros(len(samples), record)
    rows["values"], rows["since_us"] = samples[:, :4], samples[:, -1]
    return rows.tobytes()


def _run(command: Sequence[str], folder: Path) -> str:
    return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, encoding="utf-8", timeout=600, check=True).stdout


def _costs(numbers: dict[str, int], linker_map: str, objects: Sequence[str]) -> Costs:
    a_tick = 2 * _LOOPS / numbers["loop"]

    def total(name: str) -> float:
        return a_tick * (numbers[f"{name}_sum_high"] * 2**24 + numbers[f"{name}_sum_low"])

    def count(name: str) -> Count:
        calls = numbers[f"{name}_calls"]
        return Count(total(name) / max(calls, 1), round(a_tick * numbers[f"{name}_most"]), calls)

    memory = {
        "flash": sum(_flash(linker_map, re.escape(name)) for name in objects),
        "flash of libm": _flash(linker_map, r"\S*/libm\.a\(\S+\)"),
        "RAM": numbers["memory"] + numbers["buffers"],
        "over a restart": numbers["nvram"],
        "stack, fast": numbers["stack_fast"],
        "stack, slow": numbers["stack_slow"],
    }
    millisecond = (total("fast") + total("slow")) / max(numbers["milliseconds"], 1)
    return Costs({name: count(name) for name in ("fast", "slow", "load", "start", "store")}, millisecond, memory)


def _flash(linker_map: str, owner: str) -> int:
    """Bytes of the sections of an object that lie in flash; a map lists them after those that were left out."""
    _, _, linked = linker_map.partition("Linker script and memory map")
    sections = rf"^ \.(?:text|rodata|data)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+) {owner}$"
    return sum(int(size, 16) for size in re.findall(sections, linked, re.MULTILINE))


def print_costs(methods: Sequence[str], calibration: str | None, recording: str | None) -> None:
    """A line an export with its instructions, another with its memory."""
    if calibration and recording:
        content, log = clutchid.read_parameters(calibration), clutchid.read(recording)
    else:
        content, log = worn_truck("A", 0, 10.0)
    for method in methods:
        observed = observer(content.actuator, method, calibration=content.calibration)
        for rates in ("two", "one"):
            costs = target_costs(observed, CStyle(rates=rates), log)
            counts = [f"{name} {c.mean:,.0f}; {c.most:,}" for name, c in costs.counts.items() if c.calls]
            print(f"{method}, {rates}: {costs.millisecond:,.0f} instructions a millisecond | {' | '.join(counts)}")
            print("    " + ", ".join(f"{name} {size:,} B" for name, size in costs.memory.items()), flush=True)
            late = target_costs(observed, CStyle(rates=rates), with_late(log)).counts["fast"].most
            print(f"    with samples 5 ms late: fast at most {late:,}")
            of = bounds(observed, CStyle(rates=rates))
            print(
                f"    bound: fast {of.usual:,.0f} ({of.steps} steps), late {of.late:,.0f}, "
                f"slow {of.slow:,.0f}, load {of.load:,.0f}"
            )


def print_proof(names: Sequence[str], calibrations: Path) -> None:
    """A line an export with what its tests on this computer and on an emulated Cortex-M4 print."""
    print("| truck | C | C against Python | `make -C test` | `make -C test arm` |\n|---|---|---|---|---|")
    for name in names:
        kind = truck(0, name) if name.startswith("h:") else truck(int(name[1:]), name[0])
        path = calibrations / f"{name.replace(':', '')}_seed1.toml"
        content = calibrated(kind, 1, path, conditions=True)
        for real in ("float", "double"):
            with tempfile.TemporaryDirectory() as folder:
                export = clutchid.export(content, folder, real=real)
                tests = [_tested(Path(folder) / "test", target) for target in ("host", "arm")]
            ways = f"{'alike' if export.holds else 'differs'}, {export.parity.pressure:.2g} Pa rms"
            print(f"| {name} | {real} | {ways} | {' | '.join(tests)} |", flush=True)


def _tested(folder: Path, target: str) -> str:
    """Lines that the test of an export prints, and its exit status where it is not 0."""
    made = subprocess.run(["make", "-C", folder, target], capture_output=True, encoding="utf-8", check=False)
    lines = re.findall(r"^(?:parity|requirements|R\d+): .*$", made.stdout, re.MULTILINE)
    return "; ".join([*lines, *([f"exit status {made.returncode}"] if made.returncode else [])])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trucks", type=int, default=24)
    parser.add_argument("--numbers", default="", help="trucks by number, in place of the first ones")
    parser.add_argument("--families", default="A,B")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--change", action="append", default=[], choices=CHANGES, help="of the drive since calibrated")
    parser.add_argument("--seed", type=int, default=2, help="of the drive")
    parser.add_argument("--wear", type=float, default=2.0, help="of the clutch in mm")
    parser.add_argument("--costs", action="store_true", help="count instructions in place of comparing")
    parser.add_argument("--method", action="append", choices=tuple(METHODS), help="of the costs; default: joint")
    parser.add_argument("--calibration")
    parser.add_argument("--log")
    parser.add_argument("--prove", default="", help="trucks whose exports run their own tests")
    parser.add_argument("--calibrations", type=Path, help="folder in which their calibrations are kept")
    options = parser.parse_args()
    if options.prove:
        print_proof(options.prove.split(","), options.calibrations)
        return
    if options.costs:
        print_costs(options.method or ["joint"], options.calibration, options.log)
        return
    numbers = [int(n) for n in options.numbers.split(",") if n] or range(options.trucks)
    heads = ("theta", "load %", "p_A Pa rms", "share of its std")
    print(f"| family | C | {' | '.join(f'{head} median, worst' for head in heads)} | flags alike |")
    print("|---|---|---|---|---|---|---|")
    changed = options.change, options.seed, 1e-3 * options.wear
    for family in options.families.split(","):
        begin = time.perf_counter()
        rows = [compared(*worn_truck(family, n, options.seconds, *changed)) for n in numbers]
        for name in (*STYLES, ROW):
            values = np.array([row[name] for row in rows])
            pairs = [f"{np.median(column):.2g}, {column.max():.2g}" for column in values[:, :4].T]
            print(f"| {family} | {name} | {' | '.join(pairs)} | {int(values[:, 4].sum())} of {len(rows)} |", flush=True)
        print(f"{family}: {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
