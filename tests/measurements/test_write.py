"""Writing: exact, whole, or not at all."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import clutchid.measurements as cio
from clutchid.errors import ExportError
from clutchid.log import COLUMNS, Log
from clutchid.measurements.columns import REQUIRED
from clutchid.measurements.source import to_frame

finite = st.floats(allow_nan=False, allow_infinity=False)
measured = finite | st.just(np.nan)
pressure = st.floats(min_value=5e-324, allow_infinity=False) | st.just(np.nan)
duty = st.floats(min_value=0, max_value=1) | st.just(np.nan)
metadata = st.dictionaries(st.text(), st.text(), max_size=3) | st.just({"start": "2024-05-01T12:00:00+02:00"})


@st.composite
def logs(draw):
    times = draw(st.lists(finite, min_size=1, max_size=8, unique=True).map(sorted))
    optional = draw(st.sets(st.sampled_from(sorted(COLUMNS))))
    columns = {}
    for name in {"position", "duty_supply", "duty_exhaust"} | optional:
        values = duty if name.startswith("duty") else pressure if COLUMNS[name] == "Pa" else measured
        columns[name] = np.array(draw(st.lists(values, min_size=len(times), max_size=len(times))))
    return Log(np.array(times), columns, metadata=draw(metadata))


@pytest.mark.parametrize("suffix", [".csv", ".CSV", ".parquet", ".mat", ".MF4"])
@settings(max_examples=40, deadline=None)
@given(log=logs())
@example(log=Log([-1.7e308, 0.0, 1.7e308], {name: [0.0, 1.0, 1.0] for name in REQUIRED[1:]}))
def test_what_is_written_is_read_back_exactly_with_its_metadata(tmp_path_factory, suffix, log):
    if suffix == ".MF4":
        pytest.importorskip("asammdf", reason="MDF is written with asammdf, of the extra mdf")
    path = tmp_path_factory.mktemp("round") / f"run{suffix}"
    cio.write(log, path)
    back = cio.read(path)
    assert back.time.tobytes() == log.time.tobytes()
    assert set(back.columns) == set(log.columns)
    for name, values in log.columns.items():
        finite_values = np.isfinite(values)
        assert np.array_equal(np.isfinite(back[name]), finite_values)
        assert back[name][finite_values].tobytes() == values[finite_values].tobytes()
    if suffix.lower() != ".csv":
        of_reading = ("source", "sha256", "ambient_Pa")
        assert {name: text for name, text in back.metadata.items() if name not in of_reading} == log.metadata


@pytest.fixture
def log():
    return Log(
        np.array([0.0, 0.1]), {"position": np.array([1e-5, np.nan]), "duty_supply": np.array([1 / 3, 1.0])}, "run"
    )


def test_csv_has_units_in_the_header_and_empty_cells(tmp_path, log):
    cio.write(log, tmp_path / "run.csv")
    header, first, second = (tmp_path / "run.csv").read_text().splitlines()
    assert header == "time [s],position [m],duty_supply [1]"
    assert first.split(",")[2] == repr(1 / 3)
    assert second == "0.1,,1.0"


@pytest.mark.parametrize(
    ("name", "what"), [("run.xlsx", "the suffix '.xlsx' is not known"), ("run", "the name has no suffix")]
)
def test_only_known_suffixes_are_written(tmp_path, log, name, what):
    with pytest.raises(ExportError, match=rf"{name}: {what}; a log is written as .csv, .parquet, .mf4 or .mat\."):
        cio.write(log, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def edged():
    """A log whose supply valve opens between two samples."""
    time = np.arange(4) * 1e-3
    columns = {"position": time, "duty_supply": np.array([0.0, 0.0, 0.7, 0.7]), "duty_exhaust": np.zeros(4)}
    return Log(time, columns, edges={"duty_supply": (np.array([0.0, 1.3e-3]), np.array([0.0, 0.7]))})


def test_parquet_keeps_the_edges_between_the_samples_exactly(tmp_path, edged):
    path = tmp_path / "log.parquet"
    cio.write(edged, path)
    (stamps, values) = cio.read(path).edges["duty_supply"]
    assert np.array_equal(stamps, edged.edges["duty_supply"][0])
    assert np.array_equal(values, edged.edges["duty_supply"][1])
    assert list(cio.read(path).edges) == ["duty_supply"]


@pytest.mark.parametrize("suffix", [".csv", ".mat"])
def test_other_formats_warn_that_they_lose_the_edges(tmp_path, edged, suffix):
    path = tmp_path / f"log{suffix}"
    with pytest.warns(UserWarning, match="does not keep the edges of duty_supply between the samples; .parquet does"):
        cio.write(edged, path)
    assert np.array_equal(cio.read(path)["duty_supply"], edged["duty_supply"])
    assert not cio.read(path).edges


def test_damaged_edges_in_a_footer_are_left_out(tmp_path, edged):
    path = tmp_path / "log.parquet"
    for text in ("nonsense", '{"duty_supply": [1, 2]}', '{"duty_supply": ["AAAA"]}', "[]"):
        to_frame(edged).write_parquet(path, metadata={"clutchid edges": text})
        assert not cio.read(path).edges
