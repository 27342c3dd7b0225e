"""A process that was started to do work ends with the one that started it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

#: Request to Linux for a signal when the thread that started this process has ended.
_PR_SET_PDEATHSIG = 1

#: Interval in s at which a process looks for the one that started it, where the system has no such request.
_GLANCE = 0.5


def end_with_parent(parent: int) -> None:
    """Let this process end when the process `parent`, which started it, is gone, however it went.

    Linux ends it at once, also within a kernel that runs, when the thread that started it has ended; elsewhere a thread
    of this process notices within half a second.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:  # it ended before this one could ask
            os._exit(1)
    else:
        threading.Thread(target=_wait, args=(parent,), daemon=True).start()


def _wait(parent: int) -> None:
    """End this process after the other one."""
    if os.name == "posix":
        while os.getppid() == parent:  # another process becomes the parent then
            time.sleep(_GLANCE)
    else:
        import psutil

        while psutil.pid_exists(parent):
            time.sleep(_GLANCE)
    os._exit(1)
