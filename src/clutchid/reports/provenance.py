"""Provenance of a page: versions, data, and the command that reproduces it."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

from clutchid.log import Log

_PACKAGES = ("clutchid", "numpy", "scipy", "numba")


def provenance(logs: Iterable[Log], command: str) -> dict[str, str]:
    """Names and values of everything needed to reproduce a page made from `logs` with `command`."""
    found = {"command": command, "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")}
    for name in _PACKAGES:
        found[name] = _version(name)
    found["Python"] = platform.python_version()
    found["machine"] = f"{platform.system()} {platform.machine()}"
    for log in logs:
        digest = log.metadata.get("sha256")
        if digest:
            found[f"SHA-256 of {log.metadata.get('source', log.name)}"] = digest
    return found


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed as a package"
