"""Which clutchid made a result: its version, and a hash of its sources, on which results depend."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path


@cache
def version_and_source() -> dict[str, str]:
    """Version and source hash of clutchid, including the ranges of the virtual fleet."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*")):
        if path.suffix in (".py", ".j2", ".toml"):
            digest.update(path.read_bytes())
    return {"clutchid": version("clutchid"), "source": digest.hexdigest()[:16]}
