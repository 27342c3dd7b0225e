"""The command ``clutchid``, also as ``python -m clutchid``."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

from clutchid.systems import STOPS, interrupt_main

#: Time in s after which an interrupt that was ignored comes again: what ignored it has ended by then.
_BEHIND = 0.05


def main() -> None:
    """Load the command line, and run it; Ctrl-C while it loads or ends stops the process without a traceback."""
    handler = signal.signal(signal.SIGINT, signal.SIG_DFL)
    open_streams()
    sys.unraisablehook = keeping_interrupts(sys.unraisablehook)
    from clutchid.cli import main as run

    try:
        signal.signal(signal.SIGINT, handler)
        for number in STOPS[1:]:  # like Ctrl-C: nothing half-written is left
            signal.signal(number, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        sys.stderr.write("clutchid: stopped.\n")
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def open_streams() -> None:
    """Open the null device in place of closed standard streams, so that no file of results takes their number.

    Standard input stays None in Python where it was closed, as a command that reads it says so.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)


def keeping_interrupts(hook: Callable[[Any], object]) -> Callable[[Any], object]:
    """Hook for errors that Python ignores, such as in a finaliser: an interrupt there comes again behind it."""

    def handle(error: Any) -> None:
        if error.exc_type is KeyboardInterrupt:
            again = threading.Timer(_BEHIND, interrupt_main)
            again.daemon = True
            again.start()
        else:
            hook(error)

    return handle


if __name__ == "__main__":
    main()
