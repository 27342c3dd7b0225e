"""Recordings as text, to be spoiled by the tests, and sources made in memory."""

import importlib.util
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from clutchid.measurements.columns import channel
from clutchid.measurements.formats.csv import file as csv_file
from clutchid.measurements.formats.csv import rows as csv_rows
from clutchid.measurements.source import Places, Raster, Source, Table

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


Columns = Mapping[str, tuple[str | None, np.ndarray]]


def _source(*rasters: Columns, path: Path = Path("day.mf4"), clock: bool = True) -> Source:
    """A source whose rasters hold those channels (unit, samples); the first channel of each is its stamps."""
    made = []
    for number, columns in enumerate(rasters):
        headings = tuple(channel(i, name, unit) for i, (name, (unit, _)) in enumerate(columns.items()))
        size = len(next(iter(columns.values()))[1])
        made.append(Raster(headings, size, f"group {number}", 0 if clock else None))

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        values = [np.asarray(samples, dtype=np.float64) for _, samples in rasters[raster].values()]
        size = made[raster].size
        for start in range(0, size, rows or max(size, 1)):
            stop = min(start + (rows or size), size)
            numbers = {i: values[i][start:stop] for i in columns}
            yield Table(made[raster].headings, numbers, stop - start, Places(first=start + 1))

    return Source(path, "MDF", tuple(made), tables)


@pytest.fixture
def source() -> Callable[..., Source]:
    """Make a source in memory, its rasters as the readers give them."""
    return _source


@pytest.fixture(scope="session")
def fuzz() -> ModuleType:
    """The benchmark that writes files of all formats, and breaks them."""
    spec = importlib.util.spec_from_file_location("fuzz", Path(__file__).parents[2] / "benchmarks" / "fuzz.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def bus_logs(data: Callable[[str], Path]) -> Path:
    """Folder with logs of real buses."""
    return data("mf4_can_logs")


@pytest.fixture(params=["numpy", "polars", "csv"])
def parser(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each library that cuts the lines of a CSV file into cells, by force."""
    _force(request.param, monkeypatch)
    return request.param


def _force(way: str, patch: pytest.MonkeyPatch) -> None:
    """Let one of the libraries cut the lines of every CSV file, whatever its size."""
    if way == "polars":
        patch.setattr(csv_file, "_SMALL", 0)
    if way == "csv":
        patch.setattr(csv_rows, "plain_text", lambda *_: None)


@pytest.fixture(scope="session")
def force() -> Callable[[str, pytest.MonkeyPatch], None]:
    """Let "numpy", "polars" or "csv" cut the lines of a CSV file."""
    return _force
