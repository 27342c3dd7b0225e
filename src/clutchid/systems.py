"""Differences between operating systems, with substitutes; no other module asks for the system.

POSIX (Linux, macOS) and Windows differ in processes, signals, locks, and in what can be waited for. A substitute is
chosen where a name is missing, so that a test can remove names.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import re
import shlex
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any, BinaryIO, NoReturn, Self

#: Signal that ends a process at once; Windows ends it for any number that it does not know.
_KILL = 9

#: Request to Linux for a signal when the thread that started this process has ended.
_PR_SET_PDEATHSIG = 1

#: Interval in s at which a process checks that its parent is alive, where the system cannot notify it.
_GLANCE = 0.5

#: Options of `subprocess.Popen` for a process that Ctrl-C in the terminal does not reach.
DETACHED: dict[str, Any] = {
    "start_new_session": True,
    "creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
}

#: Signals that ask a command to stop: Ctrl-C, a service manager, on Windows Ctrl-Break and a console that is closed.
STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))

#: Signals of a terminal that is closed.
HANG_UPS = tuple(getattr(signal, name) for name in ("SIGHUP",) if hasattr(signal, name))


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def is_linux64() -> bool:
    """Whether a binary that is compiled here runs on 64-bit Linux."""
    return sys.platform == "linux" and platform.machine() == "x86_64"


# Processes


def interpreter() -> tuple[str, dict[str, str]]:
    """Path of Python for a process of its own, and what it needs in its environment.

    On Windows the Python of a virtual environment starts another one, and its memory would be watched in its place.
    """
    base = getattr(sys, "_base_executable", None) or sys.executable
    if sys.platform == "win32" and base != sys.executable:
        return base, {"__PYVENV_LAUNCHER__": sys.executable}
    return sys.executable, {}


def end_with_parent(parent: int) -> None:
    """Let this process end when its `parent` process ends, for any reason.

    Linux ends it at once, also within a kernel that runs, when the thread that started it has ended; elsewhere a thread
    of this process notices within half a second.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, _KILL, 0, 0, 0)
        if os.getppid() != parent:  # it ended before this one could ask
            os._exit(1)
    else:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(parent: int) -> NoReturn:
    """End this process after the other one."""
    if sys.platform == "win32":
        import psutil

        with suppress(psutil.Error):
            psutil.Process(parent).wait()
    else:
        while os.getppid() == parent:  # another process becomes the parent then
            time.sleep(_GLANCE)
    os._exit(1)


def kill_session(pid: int) -> None:
    """End a process that was started `DETACHED`, with its child processes.

    Raises
    ------
    ProcessLookupError, PermissionError
        If it has ended, or is another user's.
    """
    if hasattr(os, "killpg"):
        os.killpg(pid, _KILL)
    else:
        _kill((*_descendants(pid), pid))


def end_session() -> NoReturn:
    """End this process, which was started `DETACHED`, with its child processes."""
    if hasattr(os, "killpg"):
        os.killpg(0, _KILL)
    _kill(_descendants(os.getpid()))
    os._exit(1)


def _kill(processes: Iterable[int]) -> None:
    for process in processes:
        with suppress(OSError):  # it has ended
            os.kill(process, _KILL)


def _descendants(pid: int) -> list[int]:
    import psutil

    try:
        return [child.pid for child in psutil.Process(pid).children(recursive=True)]
    except psutil.Error:
        return []


def ending(code: int) -> str:
    """End of a process by its return code, in words."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


def limit_allocations(most: int) -> None:
    """Limit the memory of this process in bytes, so that larger allocations fail; 0 for no limit.

    Only Linux can; elsewhere the process that started this one ends it by what it has in memory.
    """
    if most and sys.platform == "linux":
        with suppress(ImportError):
            import resource

            _, hard = resource.getrlimit(resource.RLIMIT_DATA)
            resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))


def give_memory_back() -> None:
    """Return freed memory to the system where the C library can; glibc keeps it in pools."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def interrupt_main() -> None:
    """Interrupt the main thread, also where it waits."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)  # Python's handler wakes the main thread of Windows


# Files

#: Place of the byte that is locked, behind any content: on Windows nobody can read what is locked.
_LOCKED_BYTE = 1 << 30

#: Times in s to wait before a file is replaced again that another program holds open, as a virus scanner does.
_PAUSES = (0.01, 0.03, 0.1, 0.3)

#: Names of devices of Windows, which no file can have, with any suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)


def lock(descriptor: int) -> bool:
    """Lock a file as long as this process holds it open; False if another one does, or where there are no locks.

    The position in the file is not kept.
    """
    with suppress(ImportError, OSError):
        if sys.platform == "win32":
            import msvcrt

            os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def user() -> str:
    """Number or name of the user, for the names of temporary folders."""
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def is_private(folder: Path) -> bool:
    """Whether `folder` is the user's and nobody else can write to it; Windows keeps a user's folders private itself."""
    if not hasattr(os, "getuid"):
        return True
    status = folder.stat() if folder.is_symlink() else folder.lstat()
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022


def reserve(file: BinaryIO, size: int) -> None:
    """Extend a file to so many bytes, which are reserved on the disk."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
    else:
        file.write(bytes(size - file.tell()))


def replace(source: Path, target: Path) -> None:
    """Rename a closed file over another file.

    Windows refuses while a program has either of them open; a short use of it is waited for.
    """
    for pause in _PAUSES if sys.platform == "win32" else ():
        try:
            source.replace(target)
        except PermissionError:
            time.sleep(pause)
        else:
            return
    source.replace(target)


def is_in_use(error: OSError) -> bool:
    """Whether a file could not be replaced because a program has it open."""
    return sys.platform == "win32" and isinstance(error, PermissionError)


def is_device(name: str) -> bool:
    """Whether a name is that of a device on Windows.

    Examples
    --------
    >>> is_device("aux.csv"), is_device("COM3"), is_device("auxiliary.csv")
    (True, True, False)
    """
    return _DEVICES.fullmatch(name.partition(".")[0].strip()) is not None


def command_line(arguments: Iterable[str]) -> str:
    """Arguments as a line that can be pasted into a terminal of this system."""
    if sys.platform != "win32":
        return shlex.join(arguments)
    plain = re.compile(r"[\w.:\\/=+@-]+")  # single quotes mean nothing to the old command prompt
    return " ".join(word if plain.fullmatch(word) else f'"{word}"' for word in arguments)


# Pipes, consoles and files of standard streams. Windows waits for none of them, so that a thread does.

#: Bytes that are read, and written, at once; parts that are read ahead.
_CHUNK, _PART, _AHEAD = 1 << 16, 1 << 12, 16

#: Time in s for which a pipe is left to fill: to wake for each line costs more than the lines.
_NAP = 0.005


def is_closed_pipe(error: OSError) -> bool:
    """Whether an error means that the reader has closed the pipe."""
    return error.errno == errno.EPIPE or (sys.platform == "win32" and error.errno == errno.EINVAL)


class Incoming:
    """Bytes as they arrive at a descriptor, which stays open, in a ``with`` block."""

    def __init__(self, descriptor: int) -> None:
        self._stream = open(os.dup(descriptor), "rb", buffering=0)  # noqa: SIM115, PTH123 - the thread closes it
        self._parts: Queue[bytes | OSError] = Queue(_AHEAD)
        self._closed = False
        threading.Thread(target=self._read, daemon=True).start()

    def next(self, seconds: float) -> bytes | None:
        """Bytes that are there within a time in s, empty ones at the end; None if there are none yet.

        Raises
        ------
        OSError
            If they cannot be read.
        """
        try:
            part = self._parts.get(timeout=max(seconds, 0.0))
        except Empty:
            return None
        if isinstance(part, OSError):
            raise part
        return part

    def close(self) -> None:
        """Stop reading; bytes that have been read remain available."""
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._closed = True
        with suppress(Empty):
            while True:  # the thread may wait for room
                self._parts.get_nowait()

    def _read(self) -> None:
        with self._stream:
            try:
                while not self._closed:
                    part = self._stream.read(_CHUNK)
                    if part is not None:  # a pipe that another program does not block on may have nothing
                        self._parts.put(part)
                    if part == b"":
                        return
                    if part is None or len(part) < _CHUNK:
                        time.sleep(_NAP)
            except OSError as error:
                self._parts.put(error)


class Outgoing:
    """Bytes written to a descriptor, which stays open, without waiting for its reader, in a ``with`` block."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = os.dup(descriptor)
        self._changed = threading.Condition()
        self._rest = memoryview(b"")
        self._taken, self._closed = 0, False
        self._error: OSError | None = None
        threading.Thread(target=self._write, daemon=True).start()

    @property
    def left(self) -> int:
        """Number of bytes that the reader has not taken.

        Raises
        ------
        OSError
            If they cannot be written.
        """
        with self._changed:
            if self._error is not None:
                raise self._error
            return len(self._rest)

    def send(self, text: bytes) -> None:
        """Begin to write a text, after the text before has been taken."""
        with self._changed:
            self._rest = memoryview(text)
            self._changed.notify_all()

    def wait(self, seconds: float) -> bool:
        """Whether a part of the text is taken within a time in s; an error ends the wait."""
        with self._changed:
            before = self._taken
            self._changed.wait_for(lambda: self._taken > before or not self._rest or self._error is not None, seconds)
            return self._taken > before or not self._rest

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        with self._changed:  # no further part is written
            self._closed = True
            self._changed.notify_all()

    def _write(self) -> None:
        try:
            while part := self._next():
                try:
                    count = os.write(self._descriptor, part)
                except BlockingIOError:  # another program does not block on it
                    time.sleep(_NAP)
                    continue
                with self._changed:
                    self._rest = self._rest[count:]
                    self._taken += count
                    self._changed.notify_all()
        except OSError as error:
            with self._changed:
                self._error = error
                self._changed.notify_all()
        finally:
            os.close(self._descriptor)

    def _next(self) -> memoryview:
        """The next part, once there is one; empty where this is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._rest)
            return memoryview(b"") if self._closed else self._rest[:_PART]
