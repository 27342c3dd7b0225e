"""``python -m clutchid``."""

from clutchid.cli import main

main()
