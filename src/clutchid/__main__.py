"""The command ``clutchid``, also as ``python -m clutchid``."""

from __future__ import annotations

import signal


def main() -> None:
    """Load the command line, and run it; Ctrl-C while it loads ends the process without a word."""
    known = signal.signal(signal.SIGINT, signal.SIG_DFL)
    from clutchid.cli import main as run

    signal.signal(signal.SIGINT, known)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # like Ctrl-C: nothing half-written is left
    run()


if __name__ == "__main__":
    main()
