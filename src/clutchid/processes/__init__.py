"""Guarded worker processes: a fault in their work ends only the worker, and workers end with their parent.

`Worker` is one process that answers questions within limits of memory and time: foreign files are read in one
(`clutchid.measurements.opening`). `Pool` keeps some of them for pieces of work, and `results` shares the work on many
items between them. `serving` runs in a worker, `frames` are the messages between both sides.
"""

from clutchid.processes.pool import FinishedWork, LostWork, Pool, Timing, check_workers, results
from clutchid.processes.worker import Limits, Worker, WorkerEnd

__all__ = ["FinishedWork", "Limits", "LostWork", "Pool", "Timing", "Worker", "WorkerEnd", "check_workers", "results"]
