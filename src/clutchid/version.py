"""Version of the package that is installed."""

from __future__ import annotations


def installed_version() -> str:
    """Version of clutchid, as its metadata have it."""
    from importlib.metadata import version  # takes 20 ms to import

    return version("clutchid")
