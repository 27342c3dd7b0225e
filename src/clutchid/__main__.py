"""The command ``clutchid``, also as ``python -m clutchid``."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Load the command line, and run it; Ctrl-C while it loads or ends stops the process without a traceback."""
    known = signal.signal(signal.SIGINT, signal.SIG_DFL)
    from clutchid.cli import main as run

    try:
        signal.signal(signal.SIGINT, known)
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # like Ctrl-C: nothing half-written is left
        run()
    except KeyboardInterrupt:
        sys.exit("clutchid: stopped.")
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


if __name__ == "__main__":
    main()
