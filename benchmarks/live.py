"""How much faster than real time a live recording is followed: ``python benchmarks/live.py [--repeats 5] [--hours 1]``.

The recording of a virtual truck at 1 kHz, again and again, goes to ``clutchid observe`` as CSV and as JSON lines on
standard input, and as frames (position and duty cycles in a message each) on a virtual CAN bus. Everything counts:
parsing or decoding, sorting, the observer, and writing the files. The real-time factor is that of what a long stream
takes more than a short one; the start is the rest. On the bus the sender works in the same process and counts too;
what it takes for itself is shown apart. Memory is that of the process after a tenth of a long stream, and before its
end; the bus sends that one 20 times as fast as in reality.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import resource
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import psutil
from live_faults import KINDS, fault_table, outcomes

from clutchid.cli import main as clutchid
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.messages import text_table
from clutchid.truck import drive, truck

#: Truck, seconds of its recording, and its wear in m.
TRUCK, SECONDS, WEAR = 7, 60.0, 1.5e-3

#: Seconds of the short and of the long stream.
SHORT, LONG = 60, 240

#: How much faster than real time the bus is whose memory is shown, so that frames do not pile up on it.
PACE = 20.0

#: Virtual bus, and identifiers of the messages of the position and of the duty cycles.
CHANNEL, CLUTCH, VALVES = "truck", 0x123, 0x200

DBC = """VERSION ""

NS_ :

BS_:

BU_: ECU

BO_ 291 Clutch: 4 ECU
 SG_ Travel : 0|32@1- (0.000001,0) [0|0] "mm" ECU

BO_ 512 Valves: 4 ECU
 SG_ Supply : 0|16@1+ (0.00002,0) [0|0] "" ECU
 SG_ Exhaust : 16|16@1+ (0.00002,0) [0|0] "" ECU
"""

MAP = """[position]
channel = "Travel"

[duty_supply]
channel = "Supply"
unit = "1"

[duty_exhaust]
channel = "Exhaust"
unit = "1"
"""

BUS = [f"can:virtual:{CHANNEL}", "--dbc", "bus.dbc", "--map", "map.toml"]
OBSERVE = ["--start", "cal.toml", "--out", "est.parquet"]


class Run(NamedTuple):
    """Wall time in s of a stream, that of the sender alone, and memory in MiB early and at the end."""

    wall: float
    sender: float
    early: float
    end: float


def prepared(folder: Path) -> Log:
    """The recording of a worn truck, in a folder with a calibration, DBC and map."""
    new = ["drive", "--truck", str(TRUCK), "--seconds", "10", "--out", "cal.csv"]
    calibrate = ["fit", "cal.csv", "--measure", "position,pressure_a", "--free", "auto", "--save", "cal.toml"]
    for command in (new, calibrate):
        subprocess.run([sys.executable, "-m", "clutchid", *command], cwd=folder, check=True, capture_output=True)
    (folder / "bus.dbc").write_text(DBC)
    (folder / "map.toml").write_text(MAP)
    return drive(truck(TRUCK), seconds=SECONDS, seed=5, wear=WEAR, cycles=4.5e5, pressure=False).log


def csv_lines(log: Log, seconds: int) -> Iterator[bytes]:
    """The recording again and again, as CSV in pieces of a second."""
    yield b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n"
    names = ("position", *INPUTS)
    rows = [",".join(map(repr, row)) for row in zip(*(log[name].tolist() for name in names), strict=True)]
    yield from _seconds(rows, seconds, "{:.3f},{}\n")


def json_lines(log: Log, seconds: int) -> Iterator[bytes]:
    """The same as JSON lines."""
    columns = zip(*(log[name].tolist() for name in ("position", *INPUTS)), strict=True)
    rows = [f'"position [m]": {y!r}, "duty_supply [1]": {u!r}, "duty_exhaust [1]": {v!r}' for y, u, v in columns]
    yield from _seconds(rows, seconds, '{{"time [s]": {:.3f}, {}}}\n')


def _seconds(rows: Sequence[str], seconds: int, line: str) -> Iterator[bytes]:
    for second in range(seconds):
        numbers = range(1000 * second, 1000 * (second + 1))
        yield "".join([line.format(i / 1000.0, rows[i % len(rows)]) for i in numbers]).encode()


def piped(folder: Path, pieces: Iterator[bytes], seconds: int) -> Run:
    """Follow a stream on standard input in a process of its own."""
    content = list(pieces) if seconds <= LONG else pieces
    begin = time.perf_counter()
    command = [sys.executable, "-m", "clutchid", "observe", "-", *OBSERVE]
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin
    memory, early = psutil.Process(process.pid), 0.0
    for number, piece in enumerate(content):
        process.stdin.write(piece)
        if number <= max(SHORT, 0.1 * seconds):
            early = _mebibytes(memory)
    end = _mebibytes(memory)
    said = process.communicate()[0].decode()
    wall = time.perf_counter() - begin
    _check(folder, said, seconds)
    return Run(wall, 0.0, early, end)


def hours_of(folder: Path, log: Log, hours: float) -> list[tuple[str, ...]]:
    """A long stream of CSV at full speed: real-time factor on the clock and by the processor's time, and memory.

    Processor time is what counts on a machine that others use too; both include the start.
    """
    seconds = round(3600 * hours)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = piped(folder, csv_lines(log, seconds), seconds)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [
        (f"CSV, {hours:g} h at full speed", "x real time", "x by processor time", "MiB early", "MiB at the end"),
        ("", f"{seconds / run.wall:.0f}", f"{seconds / used:.0f}", f"{run.early:.0f}", f"{run.end:.0f}"),
    ]


def share(folder: Path, log: Log, seconds: int = 30) -> float:
    """Part of a processor that a stream of CSV in real time takes, a line each millisecond, after the first 10 s."""
    command = [sys.executable, "-m", "clutchid", "observe", "-", *OBSERVE]
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stdin
    lines = b"".join(csv_lines(log, seconds)).splitlines(keepends=True)
    begin, used, sent = time.perf_counter(), 0.0, 0
    while sent < len(lines):
        passed = time.perf_counter() - begin
        ready = min(len(lines), 1 + round(1000.0 * passed))
        process.stdin.write(b"".join(lines[sent:ready]))
        process.stdin.flush()
        sent = ready
        used = used if used or passed < 10.0 else sum(psutil.Process(process.pid).cpu_times()[:2])
        time.sleep(5e-4)
    part = (sum(psutil.Process(process.pid).cpu_times()[:2]) - used) / (seconds - 10.0)
    process.communicate()
    return float(part)


def latency(folder: Path, log: Log, seconds: int) -> list[tuple[str, ...]]:
    """How old published samples are, with a yardstick: a process beside it that sends each line back at once.

    Both get the same lines at the same time, in real time; the state is saved, and files are flushed, each minute.
    """
    echo = "import os\nwhile part := os.read(0, 65536): os.write(1, part)"
    observe = [sys.executable, "-m", "clutchid", "observe", "-", *OBSERVE, "--save", "state.toml", "--publish", "-"]
    commands = {"clutchid observe --publish -": observe, "yardstick: the lines sent back": [sys.executable, "-c", echo]}
    lines = b"".join(csv_lines(log, seconds)).splitlines(keepends=True)
    processes = [
        subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for command in commands.values()
    ]
    arrived: list[list[tuple[float, bytes]]] = [[] for _ in processes]
    readers = [
        threading.Thread(target=_receive, args=(process, into))
        for process, into in zip(processes, arrived, strict=True)
    ]
    for reader in readers:
        reader.start()
    begin, written = time.perf_counter(), np.empty(len(lines))
    sent = 0
    while sent < len(lines):
        ready = min(len(lines), 1 + round(1000.0 * (time.perf_counter() - begin)))
        written[sent:ready] = time.perf_counter()
        for process in processes:
            assert process.stdin
            process.stdin.write(b"".join(lines[sent:ready]))
            process.stdin.flush()
        sent = max(ready, sent)
        time.sleep(5e-4)
    for process, reader in zip(processes, readers, strict=True):
        assert process.stdin
        process.stdin.close()
        reader.join()
        process.wait()
    rows = [("latency [ms]", "samples", "median", "p99", "p99.9", "most")]
    for name, stamps in zip(commands, arrived, strict=True):
        ages = np.array([1e3 * (at - written[number]) for at, number in _numbered(stamps) if number > 10_000])
        cells = [f"{np.percentile(ages, part):.0f}" for part in (50, 99, 99.9, 100)]
        rows.append((name, f"{ages.size}", *cells))
    return rows


def _receive(process: subprocess.Popen[bytes], into: list[tuple[float, bytes]]) -> None:
    assert process.stdout
    while part := os.read(process.stdout.fileno(), 1 << 16):
        into.append((time.perf_counter(), part))


def _numbered(parts: Sequence[tuple[float, bytes]]) -> Iterator[tuple[float, int]]:
    """When each sample came, and the number of its line, by its stamp."""
    rest = b""
    for at, part in parts:
        *lines, rest = (rest + part).split(b"\n")
        for line in lines:
            match = re.match(rb'(?:{"time \[s\]": )?([0-9.]+), ?(?!"stroke"|"health")', line)
            if match:
                yield at, 1 + round(1000.0 * float(match[1]))


def _mebibytes(process: psutil.Process) -> float:
    return float(process.memory_info().rss / 2**20)


def _check(folder: Path, said: str, seconds: int) -> None:
    """Everything that was sent was followed."""
    rows = pl.scan_parquet(folder / "est.parquet").select(pl.len()).collect().item()
    if rows != 1000 * seconds or "no flags" not in said:
        raise SystemExit(f"{rows} of {1000 * seconds} samples were followed: {said}")


def on_bus(folder: Path, log: Log, seconds: int) -> Run:
    """Follow frames of a virtual bus in a process of its own, in which the sender works too."""
    context = get_context("spawn")
    mine, other = context.Pipe()
    begin = time.perf_counter()
    columns = {name: log[name] for name in ("position", *INPUTS)}
    process = context.Process(target=_bus_process, args=(folder, columns, seconds, other))
    process.start()
    memory, early, end = psutil.Process(process.pid), 0.0, 0.0
    while not mine.poll(0.2):
        passed = (time.perf_counter() - begin - 3.0) * PACE / seconds  # of the stream, if it is paced
        early = _mebibytes(memory) if passed < 0.1 else early
        end = _mebibytes(memory) if passed < 0.95 else end
    sender = mine.recv()
    process.join()
    wall = time.perf_counter() - begin
    _check(folder, (folder / "said.txt").read_text(), seconds)
    return Run(wall, sender, early, end)


def _bus_process(folder: Path, log: Mapping[str, FloatArray], seconds: int, answer: Connection) -> None:
    os.chdir(folder)
    took: list[float] = []
    pace = PACE if seconds > LONG else math.inf
    sender = threading.Thread(target=_send, args=(log, seconds, took, pace))
    sender.start()
    with (folder / "said.txt").open("w", encoding="utf-8") as sys.stdout, suppress(SystemExit):
        clutchid(["observe", *BUS, *OBSERVE])
    sender.join()
    answer.send(took[0])


def _send(
    log: Mapping[str, FloatArray],
    seconds: int,
    took: list[float],
    pace: float,
) -> None:
    """Send the recording again and again, `pace` times as fast as in reality, once somebody listens; then SIGTERM."""
    import can
    from can.interfaces.virtual import channels

    while not channels.get(CHANNEL):
        time.sleep(0.01)
    travel = [struct.pack("<i", y) for y in np.rint(log["position"] / 1e-9).astype(int).tolist()]
    duties = zip(*(np.rint(log[name] / 2e-5).astype(int).tolist() for name in INPUTS), strict=True)
    valves = [struct.pack("<HH", *pair) for pair in duties]
    begin, start = time.thread_time(), time.perf_counter()
    with can.Bus(CHANNEL, interface="virtual", preserve_timestamps=True) as bus:
        for i in range(1000 * seconds):
            at = i % len(travel)
            bus.send(can.Message(i / 1000.0, VALVES, is_extended_id=False, data=valves[at]))
            bus.send(can.Message(i / 1000.0, CLUTCH, is_extended_id=False, data=travel[at]))
            if (ahead := i / 1000.0 / pace - (time.perf_counter() - start)) > 1e-3:
                time.sleep(ahead)
    took.append(time.thread_time() - begin)
    os.kill(os.getpid(), signal.SIGTERM)


def faults(folder: Path, log: Log, options: argparse.Namespace) -> None:
    """Print what faults do to live runs, run by run where something is wrong, and then a table."""

    def worn(seconds: int) -> list[bytes]:
        return b"".join(csv_lines(log, seconds)).splitlines(keepends=True)

    failures = []
    try:
        for outcome in outcomes(folder, worn, options.runs, options.seed, options.kind, options.jobs):
            failures.append(outcome)
            if outcome.wrong:
                print(f"{outcome.kind}, run {len(failures)}: {outcome.wrong}", flush=True)
    except KeyboardInterrupt:
        print("stopped; the runs so far:")
    print(*fault_table(failures), sep="\n", flush=True)


def row(name: str, follow: Callable[[int], Run], repeats: int, hours: float) -> tuple[str, ...]:
    """A path's factors and memory."""
    follow(SHORT)
    pairs = [(follow(SHORT), follow(LONG)) for _ in range(repeats)]
    factors = [(LONG - SHORT) / (long.wall - short.wall) for short, long in pairs]
    apart = [(LONG - SHORT) / (b.wall - b.sender - a.wall + a.sender) for a, b in pairs]
    start = statistics.median(a.wall - SHORT / factor for (a, _), factor in zip(pairs, factors, strict=True))
    long = follow(round(3600 * hours))
    without = f"{statistics.median(apart):.0f}" if pairs[0][0].sender else ""
    spread = f"{statistics.median(factors):.0f} ({min(factors):.0f} to {max(factors):.0f})"
    return name, spread, without, f"{start:.1f}", f"{long.early:.0f}", f"{long.end:.0f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--hours", type=float, default=1.0, help="length of the stream whose memory is shown")
    parser.add_argument("--faults", action="store_true", help="inject faults into live runs instead")
    parser.add_argument("--runs", type=int, default=len(KINDS) * 10, help="runs with a fault, of all kinds together")
    parser.add_argument("--seed", type=int, default=1, help="of the moments of the faults")
    parser.add_argument("--jobs", type=int, default=2, help="runs with a fault at once")
    parser.add_argument("--kind", default="", help="only the faults with this text in their name")
    parser.add_argument("--fast", action="store_true", help="only a stream of CSV of --hours at full speed")
    parser.add_argument("--latency", type=int, metavar="SECONDS", default=0, help="the age of published samples")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = prepared(folder)
        if options.faults:
            faults(folder, log, options)
            return
        if options.fast:
            print(*text_table(hours_of(folder, log, options.hours), 1), sep="\n")
            return
        if options.latency:
            print(*text_table(latency(folder, log, options.latency), 1), sep="\n")
            return
        paths: dict[str, Callable[[int], Run]] = {
            "CSV": lambda seconds: piped(folder, csv_lines(log, seconds), seconds),
            "JSON lines": lambda seconds: piped(folder, json_lines(log, seconds), seconds),
            "CAN, 2 messages": lambda seconds: on_bus(folder, log, seconds),
        }
        titles = (
            "path",
            "x real time",
            "without the sender",
            "start [s]",
            "MiB early",
            f"MiB after {options.hours:g} h",
        )
        rows = [titles, *(row(path, follow, options.repeats, options.hours) for path, follow in paths.items())]
        part = share(folder, log)
    print(*text_table(rows, 1), f"CSV in real time takes {100.0 * part:.0f} % of a processor.", sep="\n")


if __name__ == "__main__":
    main()
