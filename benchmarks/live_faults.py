"""Faults injected into live runs of ``clutchid observe``: see ``python benchmarks/live.py --faults``.

Each run is a process of its own that follows a part of a recording, at 20 times real time, until a drawn moment. Then
the fault comes, and the recording goes on, or ends, or the process is killed. Afterwards a second process resumes with
the rest of the recording. Checked for each run:

- the process ends in time, with the expected exit code, and with at most one sentence, which no traceback is;
- what it wrote can be read, and its samples are those of an undisturbed run, bit by bit, up to the last one;
- nothing hidden is left in the folder, and no process;
- the second process ends with the state of an undisturbed run, bit by bit, and both files together have each sample of
  that run once.

Lost is the time in s from the last sample in the files to the last one that the process had read when the fault came.
Of a full disk it is what had been read when another program filled it. The disk is a small one in memory, which only
root can mount: without, these kinds are left out.
"""

from __future__ import annotations

import fcntl
import json
import os
import pty
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import psutil

from clutchid.cli import main as clutchid
from clutchid.log import INPUTS
from clutchid.measurements import read
from clutchid.messages import text_table
from clutchid.verbs.saving import loads_path

#: Seconds of the recording, and of the one of runs in real time; how much faster than real time the others are.
SECONDS, REAL_SECONDS, PACE = 20, 130, 20.0

#: Time in s for a process to end, from the last sample; and from one saved state to the next where runs are short.
PATIENCE, HASTE = 15.0, 0.25

#: Runs in real time at once.
TOGETHER = 10

COMMAND = [sys.executable, "-m", "clutchid"]
_HASTE = f"from clutchid.verbs.live import following; following.MINUTE = {HASTE}"
HASTY = [sys.executable, "-c", f"from clutchid.cli import main; {_HASTE}; main()"]
_PIECE = "from clutchid.measurements import spool; spool.PIECE = 1 << 16"
SMALL_PIECES = [sys.executable, "-c", f"from clutchid.cli import main; {_PIECE}; main()"]
BUS = [sys.executable, "-c", "import live_faults; live_faults.bus_process()"]
CALIBRATION = ["--start", "../cal.toml"]
BUS_OPTIONS = ["--dbc", "../bus.dbc", "--map", "../map.toml"]
CHANNEL = "truck"
DISK, FILLER = "size=128m", "filler"


class Reference(NamedTuple):
    """Lines of a recording (the first is the heading), and what an undisturbed run writes: rows, strokes, state."""

    lines: list[bytes]
    samples: pl.DataFrame
    strokes: pl.DataFrame
    state: str


class Outcome(NamedTuple):
    """Of a run: seconds lost, whether all that was read is in the files, and what was wrong, nothing if all is well."""

    kind: str
    lost: float
    complete: bool
    wrong: str


class Session:
    """A process that follows a recording, in the folder `out` of a folder of its own, and what it was given."""

    def __init__(self, place: Path, kind: Kind, lines: Sequence[bytes], draw: random.Random) -> None:
        self.kind, self.lines, self.draw, self.place = kind, lines, draw, place
        self.out = place / "out"
        self.out.mkdir(parents=True, exist_ok=True)
        self.given, self.read, self.stalled = 0, 0, threading.Event()
        self.heard = b""
        self.deaf = True
        self.master = -1
        self.reader: threading.Thread | None = None
        self.process = self._started()
        self.limit = threading.Timer(REAL_SECONDS + 60.0 if kind.real else 60.0, self.process.kill)
        self.limit.daemon = True
        self.limit.start()

    def _started(self) -> subprocess.Popen[bytes]:
        kind = self.kind
        own = "state.toml" if kind.file == "est.csv" else "out/state.toml"
        options = [*CALIBRATION, "--out", f"out/{kind.file}", "--save", own, *kind.options]
        command = [*(HASTY if kind.hasty else SMALL_PIECES if kind.disk else COMMAND), "observe", "-", *options]
        if kind.unprivileged and os.geteuid() == 0:  # root may write where nobody else may
            command = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", *command]
        errors = (self.place / "errors.txt").open("wb")
        said = (self.place / "said.txt").open("wb")
        streams: dict[str, int] = {"stdout": said.fileno(), "stderr": errors.fileno()}
        begin: Callable[[], None] | None = None
        slave = -1
        if kind.output == "full":
            streams["stdout"] = os.open("/dev/full", os.O_WRONLY)
        elif kind.output in ("pipe", "both"):
            self.master, slave = os.pipe()
            streams["stdout"] = slave
            if kind.output == "both":
                streams["stderr"] = slave
        elif kind.output == "terminal":
            self.master, slave = pty.openpty()
            streams["stdout"] = slave
            self.deaf = self.draw.random() < 0.5  # nohup
            begin = partial(_take_terminal, slave, self.deaf)
        process = subprocess.Popen(
            command, cwd=self.place, stdin=subprocess.PIPE, start_new_session=True,
            preexec_fn=begin, **streams,  # noqa: PLW1509  # no other thread holds a lock of Python's then
        )  # fmt: skip
        for file in (errors, said):
            file.close()
        if slave >= 0:
            os.close(slave)
            self.reader = threading.Thread(target=self._listen, daemon=True)
            self.reader.start()
        return process

    def _listen(self) -> None:
        """Read what the process publishes until the fault."""
        with suppress(OSError):
            while not self.stalled.is_set():
                part = os.read(self.master, 1 << 12)
                if not part:
                    return
                self.heard = (self.heard + part)[-20000:]

    def give(self, until: int, pace: float = PACE) -> None:
        """Give the lines before number `until`, at a pace; stop where nobody takes them."""
        begin, before = time.perf_counter(), self.given
        stdin = self.process.stdin
        assert stdin
        with suppress(BrokenPipeError):
            while self.given < until:
                passed = time.perf_counter() - begin
                ready = min(until, before + 1 + round(1000.0 * pace * passed))
                self._write(b"".join(self.lines[self.given : ready]))
                self.given = ready
                time.sleep(0.005 if pace > 1.0 else 0.002)

    def _write(self, text: bytes) -> None:
        assert self.process.stdin
        self.process.stdin.write(text)
        self.process.stdin.flush()

    def begun(self) -> None:
        """Wait until the first samples were read."""
        until = time.monotonic() + 60.0
        while time.monotonic() < until and not (
            list(self.out.glob(".clutchid-live-*")) or self.process.poll() is not None
        ):
            time.sleep(0.02)

    def note(self) -> None:
        """Note how many lines have been read by now: those that were given less those in the pipe."""
        assert self.process.stdin
        unread = bytearray(4)
        fcntl.ioctl(self.process.stdin.fileno(), termios.FIONREAD, unread)
        left = int.from_bytes(unread, sys.byteorder)
        count = self.given
        while left > 0 and count > 0:
            count -= 1
            left -= len(self.lines[count])
        self.read = count

    def close(self) -> None:
        """End the recording."""
        if self.process.stdin:
            with suppress(OSError):
                self.process.stdin.close()

    def ended(self) -> int | None:
        """Exit code; None if the process did not end in time."""
        try:
            code = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            code = None
        self.limit.cancel()
        self.stalled.set()
        if self.reader is not None:
            self.reader.join(0.5)
        if self.master >= 0:
            with suppress(OSError):
                os.close(self.master)
        return code

    @property
    def errors(self) -> str:
        """What it said on standard error."""
        text = (self.place / "errors.txt").read_text(errors="replace")
        return text + (self.heard.decode(errors="replace") if self.kind.output == "both" else "")


def _take_terminal(slave: int, deaf: bool) -> None:
    fcntl.ioctl(slave, termios.TIOCSCTTY, 0)
    if deaf:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)


Inject = Callable[[Session], None]


class Kind(NamedTuple):
    """A kind of fault.

    `inject` brings the fault; `goes_on` is whether the recording goes on behind it; `codes` are the exit codes that it
    may have; `spoiled` spoils a line; `output` is where standard output, or standard error, goes to.
    """

    inject: Inject = lambda _session: None
    goes_on: bool = True
    codes: tuple[int, ...] = (0,)
    options: tuple[str, ...] = ()
    spoiled: Callable[[random.Random, bytes], bytes] | None = None
    first: bool = False
    output: str = ""
    file: str = "est.parquet"
    hasty: bool = False
    real: bool = False
    unprivileged: bool = False
    disk: bool = False
    killed: bool = False
    bus: str = ""


def _signal(number: int) -> Inject:
    return lambda session: session.process.send_signal(number)


def _stall(session: Session) -> None:
    session.stalled.set()


def _stall_and_stop(session: Session) -> None:
    session.stalled.set()
    session.give(min(session.given + 3000, len(session.lines)))
    time.sleep(session.draw.uniform(0.0, 3.0))
    session.note()
    session.process.send_signal(signal.SIGTERM)


def _hang_up(session: Session) -> None:
    session.stalled.set()
    if session.reader is not None:
        session.reader.join(0.2)
    os.close(session.master)
    session.master = -1


def _fill(session: Session) -> None:
    """Fill the small disk up to a little room, as another program would."""
    disk = os.statvfs(session.out)
    left = session.draw.randint(20_000, 700_000)
    with suppress(OSError):  # the process writes as well
        (session.out / FILLER).write_bytes(bytes(max(0, disk.f_bavail * disk.f_frsize - left)))


@contextmanager
def _small_disk(place: Path) -> Iterator[None]:
    """A disk in memory at a new folder."""
    place.mkdir(parents=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", DISK, "tmpfs", str(place)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def _remove(session: Session) -> None:
    while session.out.exists():
        shutil.rmtree(session.out, ignore_errors=True)


def _protect(session: Session) -> None:
    session.out.chmod(0o500)


def _jump(draw: random.Random, line: bytes) -> bytes:
    """A stamp far ahead: its point is lost, or a digit is more in front of it."""
    stamp, rest = line.split(b",", 1)
    ahead = stamp.replace(b".", b"") if draw.random() < 0.5 else str(draw.randint(1, 9)).encode() + b"00" + stamp
    return ahead + b"," + rest


def _huge(_draw: random.Random, line: bytes) -> bytes:
    return b"1e300," + line.split(b",", 1)[1]


def _either(draw: random.Random, line: bytes) -> bytes:
    return draw.choice((b"1e9,", b"1e300,", b"-5,", b"nan,")) + line.split(b",", 1)[1]


KINDS: dict[str, Kind] = {
    "stamp jumps ahead": Kind(spoiled=_jump),
    "stamp 1e300": Kind(spoiled=_huge),
    "first stamp spoiled": Kind(spoiled=_either, first=True),
    "disk full, Parquet": Kind(_fill, codes=(0, 1), disk=True),
    "disk full, CSV": Kind(_fill, codes=(0, 1), disk=True, file="est.csv"),
    "standard output full": Kind(options=("--publish", "-"), output="full"),
    "pipe closed": Kind(_hang_up, options=("--publish", "-"), output="pipe"),
    "reader stalls": Kind(_stall, options=("--publish", "-"), output="pipe"),
    "reader stalls, SIGTERM": Kind(_stall_and_stop, goes_on=False, options=("--publish", "-"), output="pipe"),
    "reader of both stalls": Kind(_stall, options=("--publish", "-"), output="both"),
    "SIGTERM": Kind(_signal(signal.SIGTERM), goes_on=False),
    "SIGHUP": Kind(_signal(signal.SIGHUP), goes_on=False),
    "SIGINT": Kind(_signal(signal.SIGINT), goes_on=False),
    "SIGKILL": Kind(_signal(signal.SIGKILL), goes_on=False, codes=(-signal.SIGKILL,), hasty=True, killed=True),
    "SIGKILL in real time": Kind(
        _signal(signal.SIGKILL), goes_on=False, codes=(-signal.SIGKILL,), real=True, killed=True
    ),
    "folder removed": Kind(_remove, codes=(1,)),
    "folder write-protected": Kind(_protect, codes=(1,), unprivileged=True),
    "terminal hangs up, --publish -": Kind(_hang_up, options=("--publish", "-"), output="terminal"),
    "bus, SIGTERM": Kind(goes_on=False, bus="SIGTERM"),
    "bus, SIGKILL": Kind(goes_on=False, bus="SIGKILL", codes=(-signal.SIGKILL,), hasty=True, killed=True),
}


def reference(place: Path, lines: list[bytes]) -> Reference:
    """What is observed in a file of the lines, in a folder beside the calibration."""
    place.mkdir()
    (place / "worn.csv").write_bytes(b"".join(lines))
    options = [*CALIBRATION, "--out", "est.parquet", "--save", "state.toml"]
    subprocess.run([*COMMAND, "observe", "worn.csv", *options], cwd=place, check=True, stdout=subprocess.DEVNULL)
    samples, strokes = (pl.read_parquet(place / name) for name in ("est.parquet", "est.load.parquet"))
    return Reference(lines, samples, strokes, (place / "state.toml").read_text())


def frame_of(path: Path) -> pl.DataFrame | str:
    """A file of results, or why it cannot be read."""
    try:
        return pl.read_parquet(path) if path.suffix == ".parquet" else pl.read_csv(path, infer_schema_length=None)
    except (OSError, pl.exceptions.PolarsError) as error:
        return f"{path.name} cannot be read ({error})"


def same(observed: pl.DataFrame, wanted: pl.DataFrame) -> bool:
    """Whether two tables are the same, bit by bit; CSV has the same digits, and nothing for NaN."""
    if observed.columns != wanted.columns:
        return False
    frames = [frame.cast(dict(wanted.schema)).with_columns(pl.all().fill_nan(None)) for frame in (observed, wanted)]
    return frames[0].equals(frames[1], null_equal=True)


def one_run(folder: Path, name: str, number: int, draw: random.Random, undisturbed: Reference) -> Outcome:
    """A run of a kind, its checks, and its continuation."""
    kind, place = KINDS[name], folder / f"run{number}"
    place.mkdir(exist_ok=True)
    lines = list(undisturbed.lines)
    size = len(lines)
    moment = 1 if kind.first else draw.randint(size // 20, size * 8 // 10)
    if kind.real:
        moment = draw.randint(62_000, size - 1000)
    if kind.spoiled is not None:
        lines[moment] = kind.spoiled(draw, lines[moment])
        undisturbed = reference(folder / f"reference{number}", [*lines[:moment], *lines[moment + 1 :]])
    end = draw.randint(moment + 1, size - 500) if kind.goes_on else moment
    if kind.bus:
        return _bus_run(name, place, moment, undisturbed)
    session = Session(place, kind, lines, draw)
    session.give(min(300, moment))
    if not kind.first:
        session.begun()
        session.give(moment, 1.0 if kind.real else PACE)
    session.note()
    kind.inject(session)
    if kind.goes_on and (session.deaf or kind.inject is not _hang_up):
        session.give(end)
        session.read = session.read if kind.disk else session.given
    if kind.goes_on or kind.killed:
        session.close()
    code = session.ended()
    if session.process.stdin:
        with suppress(OSError):
            session.process.stdin.close()
    return _checked(name, session.place, session.process.pid, code, session, undisturbed)


def _checked(
    name: str, place: Path, pid: int, code: int | None, session: Session | None, undisturbed: Reference
) -> Outcome:
    kind = KINDS[name]
    assert session is not None
    wrong: list[str] = []
    if code not in kind.codes:
        wrong.append(f"exit code {code}")
    wrong += _sentences(session.errors, code)
    wrong += _left_behind(place, pid, kind)
    if kind.unprivileged:
        (place / "out").chmod(0o700)
    places = {Path(a): Path(b) for a, b in re.findall(r"(\S+): can no longer be written; it is in (\S+) instead",
                                                      session.errors)}  # fmt: skip
    read = session.read - 1 - (kind.spoiled is not None)
    file = Path("out") / kind.file
    state = Path("state.toml" if kind.file == "est.csv" else "out/state.toml")
    paths = {path: place / places.get(path, path) for path in (file, loads_path(file), state)}
    (place / "out").mkdir(exist_ok=True)
    (place / "out" / FILLER).unlink(missing_ok=True)
    saved = place / "kept"
    saved.mkdir()
    for path, where in paths.items():
        if where.exists() and path != state:
            shutil.move(where, saved / path.name)
        elif where.exists() and where != place / path:
            shutil.copy(where, place / path)
    has_state = (place / state).exists()
    wrong += _resumed(place, kind, state, undisturbed) if has_state else []
    if kind.killed:
        for path in (place / "out").glob("*.recovered*"):
            path.replace(saved / path.name.replace(".recovered", ""))
        state_needed = False
    else:
        state_needed = not kind.disk
    if not has_state and state_needed:
        wrong.append("no state")
    lost, problems = _rows(place, saved, kind, file, has_state, read, undisturbed)
    wrong += problems
    return Outcome(name, lost, lost < 0.0005, "; ".join(wrong))


def _sentences(errors: str, code: int | None) -> list[str]:
    """What is wrong with what was said: at most one error, none without one, and no traceback."""
    wrong = ["traceback"] if "Traceback" in errors or "did not expect" in errors else []
    count = len(re.findall(r"^clutchid: ", errors, re.MULTILINE))
    if count != (1 if code in (1, 2) else 0):
        wrong.append(f"{count} sentences")
    return wrong


def _left_behind(place: Path, pid: int, kind: Kind) -> list[str]:
    """Hidden files and processes that are left."""
    wrong = []
    alive = [process.pid for process in psutil.process_iter() if _session_of(process.pid) == pid]
    if alive:
        wrong.append(f"{len(alive)} processes left")
    hidden = [path.name for path in place.rglob(".*")]
    if hidden and not kind.killed and not kind.unprivileged:
        wrong.append(f"left {hidden}")
    return wrong


def _session_of(pid: int) -> int:
    try:
        return os.getsid(pid)
    except OSError:
        return -1


def _resumed(place: Path, kind: Kind, state: Path, undisturbed: Reference) -> list[str]:
    """What is wrong with a run that goes on from a state, in the same place, to the end."""
    latest = tomllib.loads((place / state).read_text())["tail"]["time"][-1]
    at = 1 + int(np.searchsorted(undisturbed.samples["time [s]"].to_numpy(), latest, side="right"))
    options = [*CALIBRATION, "--out", f"out/{kind.file}", "--save", str(state), "--resume", str(state)]
    rest = b"".join([undisturbed.lines[0], *undisturbed.lines[at:]])
    command = [*COMMAND, "observe", "-", *options]
    finished = subprocess.run(command, cwd=place, input=rest, capture_output=True, check=False)
    code, said = finished.returncode, " ".join(finished.stderr.decode().split())
    wrong = [] if code == 0 else [f"resumed with exit code {code}: {said[-300:]}"]
    if code == 0 and (place / state).read_text() != undisturbed.state:
        wrong.append("another state at the end")
    hidden = [path.name for path in place.rglob(".*")]
    return [*wrong, *([f"left {hidden} after resuming"] if hidden else [])]


def _rows(
    place: Path, saved: Path, kind: Kind, file: Path, has_state: bool, read: int, undisturbed: Reference
) -> tuple[float, list[str]]:
    """Seconds lost of what was read, and what is wrong with the samples and strokes."""
    wrong: list[str] = []
    count = 0
    for name, wanted in ((file, undisturbed.samples), (loads_path(file), undisturbed.strokes)):
        before = frame_of(saved / name.name) if (saved / name.name).exists() else wanted.head(0)
        if isinstance(before, str):
            wrong.append(before)
            continue
        if not same(before, wanted.head(before.height)):
            wrong.append(f"{name.name}: other samples")
        if name == file:
            count = before.height
        after = frame_of(place / name) if (place / name).exists() else wanted.head(0)
        if isinstance(after, str):
            wrong.append(after)
        elif has_state and not same(after, wanted.tail(after.height)):
            wrong.append(f"{name.name}: other samples after resuming")
        elif has_state and not kind.disk and before.height + after.height != wanted.height:
            wrong.append(f"{name.name}: {before.height} + {after.height} rows for {wanted.height}")
    return max(0.0, (read - count) / 1000.0), wrong


def _bus_run(name: str, place: Path, moment: int, undisturbed: Reference) -> Outcome:
    """A run on a virtual bus, whose sender works in the same process."""
    kind = KINDS[name]
    (place / "out").mkdir()
    how = {"send": [0, moment], "fault": kind.bus, "hasty": kind.hasty}
    code, pid = _on_bus(place, how, [], "errors.txt")
    wrong: list[str] = []
    if code not in kind.codes:
        wrong.append(f"exit code {code}")
    errors = (place / "errors.txt").read_text(errors="replace")
    wrong += [*_sentences(errors, code), *_left_behind(place, pid, kind)]
    saved = place / "kept"
    saved.mkdir()
    file, state = Path("out/est.parquet"), place / "out" / "state.toml"
    for path in (file, loads_path(file)):
        if (place / path).exists():
            (place / path).replace(saved / path.name)
    if has_state := state.exists():
        latest = tomllib.loads(state.read_text())["tail"]["time"][-1]
        at = int(np.searchsorted(undisturbed.samples["time [s]"].to_numpy(), latest, side="right"))
        how = {"send": [at, len(undisturbed.lines) - 1], "fault": "", "hasty": False}
        again, _ = _on_bus(place, how, ["--resume", "out/state.toml"], "again.txt")
        if again != 0:
            said = " ".join((place / "again.txt").read_text().split())
            wrong.append(f"resumed with exit code {again}: {said[-300:]}")
        elif state.read_text() != undisturbed.state:
            wrong.append("another state at the end")
    elif not kind.killed:
        wrong.append("no state")
    if kind.killed:
        for path in (place / "out").glob("*.recovered*"):
            path.replace(saved / path.name.replace(".recovered", ""))
    lost, problems = _rows(place, saved, kind, file, has_state, moment, undisturbed)
    return Outcome(name, lost, lost < 0.0005, "; ".join([*wrong, *problems]))


def _on_bus(place: Path, how: dict[str, object], options: Sequence[str], errors: str) -> tuple[int | None, int]:
    """Exit code, None if it did not end in time, and number of a process on a virtual bus."""
    arguments = [*CALIBRATION, *BUS_OPTIONS, "--out", "out/est.parquet", "--save", "out/state.toml", *options]
    path = os.pathsep.join([str(Path(__file__).parent.resolve()), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "LIVE_FAULT": json.dumps(how), "PYTHONPATH": path}
    with (place / errors).open("wb") as said:
        process = subprocess.Popen(
            [*BUS, "observe", f"can:virtual:{CHANNEL}", *arguments], cwd=place, stdout=subprocess.DEVNULL, stderr=said,
            start_new_session=True, env=environment,
        )  # fmt: skip
        try:
            return process.wait(PATIENCE + SECONDS), process.pid
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return None, process.pid


def bus_process() -> None:
    """Follow a virtual bus on which a thread of this process sends, as the environment says; with its fault."""

    from clutchid.verbs.live import following

    how = json.loads(os.environ["LIVE_FAULT"])
    if how["hasty"]:
        following.MINUTE = HASTE
    threading.Thread(target=_send_on_bus, args=(how,), daemon=True).start()
    clutchid()


def _send_on_bus(how: dict[str, object]) -> None:
    import can
    from can.interfaces.virtual import channels

    frames = json.loads(Path("../frames.json").read_text())
    while not channels.get(CHANNEL):
        time.sleep(0.01)
    first, last = how["send"]
    begin = time.perf_counter()
    with can.Bus(CHANNEL, interface="virtual", preserve_timestamps=True) as bus:
        for i in range(first, last):
            stamp, valves, clutch = frames[i]
            bus.send(can.Message(stamp, 0x200, is_extended_id=False, data=bytes.fromhex(valves)))
            bus.send(can.Message(stamp, 0x123, is_extended_id=False, data=bytes.fromhex(clutch)))
            if (ahead := (i - first) / 1000.0 / PACE - (time.perf_counter() - begin)) > 1e-3:
                time.sleep(ahead)
        if how["fault"] != "SIGKILL":
            time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGKILL if how["fault"] == "SIGKILL" else signal.SIGTERM)
        time.sleep(PATIENCE)


def prepared_bus(folder: Path, lines: Sequence[bytes]) -> Reference:
    """The recording as frames in a file, and what an undisturbed run on the bus finds."""
    log = read(folder / "reference" / "worn.csv")
    travel = np.rint(log["position"] / 1e-9).astype(int).tolist()
    duties = zip(*(np.rint(log[name] / 2e-5).astype(int).tolist() for name in INPUTS), strict=True)
    stamps = (1.7e9 + log.time).tolist()
    frames = [
        (stamp, struct.pack("<HH", *u).hex(), struct.pack("<i", y).hex())
        for stamp, y, u in zip(stamps, travel, duties, strict=True)
    ]
    (folder / "frames.json").write_text(json.dumps(frames))
    place = folder / "bus"
    (place / "out").mkdir(parents=True)
    code, _ = _on_bus(place, {"send": [0, len(frames)], "fault": "", "hasty": False}, [], "errors.txt")
    assert code == 0, (place / "errors.txt").read_text()
    samples, strokes = (pl.read_parquet(place / "out" / name) for name in ("est.parquet", "est.load.parquet"))
    assert samples.height == len(frames)
    return Reference(list(lines), samples, strokes, (place / "out" / "state.toml").read_text())


def outcomes(
    folder: Path, worn: Callable[[int], list[bytes]], runs: int, seed: int, only: str, jobs: int
) -> Iterator[Outcome]:
    """Runs of each kind in turn, `runs` in all, `jobs` at once; those in real time first, more at once."""
    names = [name for name, kind in KINDS.items() if only in name and (os.geteuid() == 0 or not kind.disk)]
    drawn = [names[i % len(names)] for i in range(runs)]
    undisturbed = reference(folder / "reference", worn(SECONDS))
    on_bus = prepared_bus(folder, undisturbed.lines) if any(KINDS[name].bus for name in names) else None
    long = reference(folder / "long", worn(REAL_SECONDS)) if any(KINDS[name].real for name in names) else None

    def run(number: int) -> Outcome:
        kind = KINDS[drawn[number]]
        wanted = (long if kind.real else on_bus if kind.bus else undisturbed) or undisturbed
        with _small_disk(folder / f"run{number}" / "out") if kind.disk else nullcontext():
            return one_run(folder, drawn[number], number, random.Random(f"{seed} {number}"), wanted)

    for real, at_once in ((True, TOGETHER), (False, jobs)):
        with ThreadPoolExecutor(at_once) as pool:
            yield from pool.map(run, [i for i, name in enumerate(drawn) if KINDS[name].real == real])


def fault_table(outcomes: Sequence[Outcome]) -> list[str]:
    """A row by kind: runs, complete ones, the most seconds lost, and wrong ones."""
    rows = [("fault", "runs", "complete", "lost, most [s]", "wrong")]
    for name in dict.fromkeys(outcome.kind for outcome in outcomes):
        of_kind = [outcome for outcome in outcomes if outcome.kind == name]
        complete, wrong = sum(outcome.complete for outcome in of_kind), sum(bool(outcome.wrong) for outcome in of_kind)
        rows.append(
            (name, f"{len(of_kind)}", f"{complete}", f"{max(outcome.lost for outcome in of_kind):.2f}", f"{wrong}")
        )
    complete, wrong = sum(outcome.complete for outcome in outcomes), sum(bool(outcome.wrong) for outcome in outcomes)
    rows.append(
        (
            "all",
            f"{len(outcomes)}",
            f"{complete}",
            f"{max((outcome.lost for outcome in outcomes), default=0.0):.2f}",
            f"{wrong}",
        )
    )
    return text_table(rows, 1)
