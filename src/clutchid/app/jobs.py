"""`Jobs`: a process for each job, a few at a time, with events for a listener; a spare process has its imports done.

A process leads a session of its own, so that all that it started ends with it.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import os
import pickle
import shutil
import sys
import time
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from clutchid.app.records import PRIVATE, Task
from clutchid.systems import DETACHED, ending, interpreter, kill_session

#: Longest event in bytes.
_LONGEST = 1 << 24

_START = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from clutchid.app.worker import main; main()"

#: Jobs of these kinds wait for one of the same lane; reading a file need not wait for a fit.
Lane = Literal["files", "fits"]

_Status = Literal["waiting", "running", "done", "failed", "cancelled"]


@dataclass(slots=True, eq=False)
class Job:
    """A job: its title, its task for the worker, and its progress."""

    id: str
    title: str
    lane: Lane = field(metadata=PRIVATE)
    task: Task = field(metadata=PRIVATE)
    about: str
    do: str
    status: _Status = "waiting"
    stage: str = ""
    share: float | None = None
    words: str = ""
    message: str = ""
    bad_input: bool = False
    began: float = 0.0
    ended: float = 0.0
    process: Process | None = field(default=None, repr=False, metadata=PRIVATE)


@dataclass(slots=True, eq=False)
class _Spare:
    """A process that waits for its task, and its folder for temporary files."""

    process: Process
    folder: Path


class Jobs:
    """Jobs in two lanes, one of each lane at a time.

    Parameters
    ----------
    folder
        Where the processes have their temporary files.
    changed
        Called with a job whenever something of it has changed.
    done
        Called with a job and its result, or with what is known of it before it is done.
    trace
        Called with the traceback of an error that nobody expected.
    """

    def __init__(
        self,
        folder: Path,
        changed: Callable[[Job], None],
        ended: Callable[[Job, dict[str, Any]], None],
        trace: Callable[[str], None],
    ) -> None:
        self._folder, self._changed, self._done, self._trace = folder, changed, ended, trace
        self._waiting: dict[Lane, deque[Job]] = {"files": deque(), "fits": deque()}
        self._running: dict[Lane, asyncio.Task[None]] = {}
        self._jobs: dict[str, Job] = {}
        self._numbers = itertools.count(1)
        self._spare: _Spare | None = None
        self._lock = asyncio.Lock()
        self._closed = False

    async def warm_up(self) -> None:
        """Start the spare process, unless there is one."""
        async with self._lock:
            if self._spare is None and not self._closed:
                self._spare = await self._started()

    def submit(self, title: str, lane: Lane, task: Task, about: str) -> Job:
        """Start a job, or queue it; `about` is the id of its record."""
        job = Job(f"job-{next(self._numbers)}", title, lane, task, about, type(task).__name__)
        self._jobs[job.id] = job
        self._waiting[lane].append(job)
        self._next(lane)
        self._changed(job)
        return job

    def cancel(self, id_: str) -> bool:
        """End a job and its child processes; False if it had ended before."""
        job = self._jobs.get(id_)
        if job is None or job.status not in ("waiting", "running"):
            return False
        if job in self._waiting[job.lane]:
            self._waiting[job.lane].remove(job)
        job.status, job.ended = "cancelled", time.time()
        if job.process is not None:
            kill_group(job.process)
        self._changed(job)
        return True

    def cancel_about(self, id_: str) -> None:
        """End all jobs of a record that is removed."""
        for job in [*self._jobs.values()]:
            if job.about == id_:
                self.cancel(job.id)

    async def close(self) -> None:
        """End all jobs, and the spare process."""
        self._closed = True
        for job in [*self._jobs.values()]:
            self.cancel(job.id)
        await asyncio.gather(*self._running.values(), return_exceptions=True)
        async with self._lock:
            if self._spare is not None:
                kill_group(self._spare.process)
                await self._spare.process.wait()
                self._spare = None

    def _next(self, lane: Lane) -> None:
        if not self._closed and lane not in self._running and self._waiting[lane]:
            job = self._waiting[lane].popleft()
            job.status, job.began = "running", time.time()
            self._running[lane] = asyncio.create_task(self._run(job))

    async def _run(self, job: Job) -> None:
        worker: _Spare | None = None
        try:
            async with self._lock:
                worker, self._spare = self._spare, None
            if worker is None or worker.process.returncode is not None:
                worker = await self._started()
            job.process = worker.process
            if job.status == "running":
                self._changed(job)
                await self._follow(job, worker.process)
        except OSError as error:
            self._failed(job, f"no process could be started for it ({error.strerror or error}).")
        finally:
            if worker is not None:
                kill_group(worker.process)
                await worker.process.wait()
                shutil.rmtree(worker.folder, ignore_errors=True)
            del self._running[job.lane]
            self._next(job.lane)
            if not self._closed:
                with contextlib.suppress(OSError):
                    await self.warm_up()

    async def _follow(self, job: Job, process: Process) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(ConnectionError):
            process.stdin.write(pickle.dumps(job.task))
            await process.stdin.drain()
        async for line in process.stdout:
            event = json.loads(line)
            if job.status != "running":
                return
            if event["event"] == "progress":
                job.stage, job.words = event["stage"], event["words"]
                job.share = event["share"]
                self._changed(job)
            elif event["event"] == "part":
                self._done(job, event["result"])
            elif event["event"] == "failed":
                job.bad_input = event["status"] == "bad_input"
                if event.get("traceback"):
                    self._trace(event["traceback"])
                self._failed(job, event["message"])
                return
            elif event["event"] == "done":
                job.status, job.share, job.ended = "done", 1.0, time.time()
                self._done(job, event["result"])
                self._changed(job)
                return
        code = await process.wait()
        if job.status == "running":
            self._failed(
                job, f"the process of this job ended ({ending(code)}); memory may have run out. Start it again."
            )

    def _failed(self, job: Job, message: str) -> None:
        job.status, job.message, job.ended = "failed", message, time.time()
        self._changed(job)

    async def _started(self) -> _Spare:
        folder = self._folder / f"process-{next(self._numbers)}"
        folder.mkdir(mode=0o700, parents=True)
        temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))
        python, additions = interpreter()
        process = await asyncio.create_subprocess_exec(
            python, "-P", "-c", _START, json.dumps(sys.path),
            stdin=PIPE, stdout=PIPE, stderr=DEVNULL, limit=_LONGEST,
            env={**os.environ, **additions, **temporary}, **DETACHED,
        )  # fmt: skip
        return _Spare(process, folder)


def kill_group(process: Process) -> None:
    """End a process and all of its session."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        if process.returncode is not None:
            return  # its number may be that of another process by now
        kill_session(process.pid)
