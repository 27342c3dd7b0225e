"""Recordings as text, to be spoiled by the tests."""

from collections.abc import Callable
from pathlib import Path

import pytest

HEADER = "time [s],position [m],duty_supply [1],duty_exhaust [1],pressure_a [Pa]"


@pytest.fixture
def recording() -> Callable[..., str]:
    """A good recording as CSV text: sample i stands on line i + 2; `cells` replaces cells by (sample, column)."""

    def make(samples: int = 10, cells: dict[tuple[int, int], str] | None = None, header: str = HEADER) -> str:
        rows = [[f"{i / 1000:.3f}", f"{i / 1e4:.4f}", "0.5", "0.0", "150000.0"] for i in range(samples)]
        for (sample, column), text in (cells or {}).items():
            rows[sample][column] = text
        return "\n".join([header, *(",".join(row) for row in rows)]) + "\n"

    return make


@pytest.fixture
def save(tmp_path: Path) -> Callable[..., Path]:
    """Write text or bytes to a file and return its path."""

    def to_file(content: str | bytes, name: str = "run.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return to_file
