"""Reading CSV that is good, if odd."""

import hashlib
import subprocess
import sys
import warnings

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import clutchid.measurements as cio
from clutchid.errors import ParameterError
from clutchid.log.units import UNITS
from clutchid.measurements.formats.csv import file as csv_file
from clutchid.measurements.formats.csv import rows as csv_rows
from clutchid.strokes.vented_pressure import VENTED_KEY

INPUTS = "duty_supply [1],duty_exhaust [1]"


def load(path):
    """The only table of a file, with every column."""
    source = csv_file.open_file(path)
    return next(source.tables(0, range(len(source.rasters[0].headings))))


def test_a_recording_is_read_in_si_with_its_origin(recording, save):
    path = save(recording(3), "truck 7.csv")
    log = cio.read(path)
    assert log.name == "truck 7"
    assert log.time.tolist() == [0.0, 0.001, 0.002]
    assert log["position"].tolist() == [0.0, 0.0001, 0.0002]
    assert log["pressure_a"].tolist() == [150000.0] * 3
    assert log.warnings == ()
    assert dict(log.metadata) == {
        "source": "truck 7.csv",
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "ambient_Pa": "101300.0",
        "dialect": "UTF-8, comma, decimal point, names on line 1, samples from line 2",
    }


def test_every_unit_is_converted(save):
    quantities = {"s": "time", "m": "position", "1": "duty_supply", "m/s": "velocity", "K": "temperature_a"}
    quantities |= {"Pa": "pressure_b", "N": "force"}
    required = {"time": "s", "position": "m", "duty_supply": "1", "duty_exhaust": "1"}
    for text, unit in UNITS.items():
        header = ",".join(f"{name} [{si}]" for name, si in (required | {quantities[unit.si]: text}).items())
        log = cio.read(save(f"{header}\n" + ",".join(["0.5"] * (header.count(",") + 1)) + "\n"), ambient=1e5)
        name = quantities[unit.si]
        value = log.time[0] if name == "time" else log[name][0]
        assert value == pytest.approx(0.5 * unit.scale + unit.offset + (1e5 if unit.gauge else 0), rel=1e-15)


def test_gauge_pressure_is_raised_by_the_ambient_pressure(recording, save):
    path = save(recording(2, {(0, 4): "0", (1, 4): "7.905"}).replace("[Pa]", "[bar(g)]"))
    assert cio.read(path)["pressure_a"].tolist() == [1.013e5, 8.918e5]
    log = cio.read(path, ambient=1e5)
    assert log["pressure_a"][0] == 1e5
    assert log.metadata["ambient_Pa"] == "100000.0"


def test_an_ambient_pressure_that_is_stated_is_what_a_vented_chamber_has(recording, save):
    path = save(recording(2))
    assert VENTED_KEY not in cio.read(path).metadata
    assert cio.read(path, ambient=95e3).metadata[VENTED_KEY] == "95000.0"
    added = cio.read(path, added=95e3).metadata
    assert (added["ambient_Pa"], VENTED_KEY in added) == ("95000.0", False), "of a model, which may be a guess"
    assert cio.read(path, ambient=96e3, added=95e3).metadata["ambient_Pa"] == "96000.0"


@pytest.mark.parametrize("ambient", [0.0, -1.0, np.nan, np.inf])
def test_an_ambient_pressure_is_above_zero(recording, save, ambient):
    words = r"ambient = .* Pa: an absolute pressure must be above 0. "
    with pytest.raises(ParameterError, match=words):
        cio.read(save(recording()), ambient=ambient)


def test_names_with_wildcards_or_an_archive_suffix_are_names(recording, save, parser):
    for name in ("run[1]*.csv", "run.csv.gz", "run"):
        assert len(cio.read(save(recording(4), name))) == 4


def test_no_new_warnings_are_raised_by_extreme_numbers(save):
    path = save(f"time [min],position [m],{INPUTS}\n-1.7e306,1e308,0,0\n1.7e306,-1e308,0,0\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(cio.read(path)) == 2


cells = st.one_of(st.floats().map(repr), st.text(alphabet="+-.0123456789einfa_xE \"'#", max_size=6))


@settings(max_examples=150, deadline=None)
@given(rows=st.lists(st.tuples(cells, cells), min_size=1, max_size=4), small=st.sampled_from([0, 1e9]))
def test_every_library_reads_the_same_numbers(tmp_path_factory, rows, small):
    path = tmp_path_factory.mktemp("cells") / "run.csv"
    path.write_text("position [m],velocity [m/s]\n" + "".join(f"{a},{b}\n" for a, b in rows))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_file, "_SMALL", small)
        fast = load(path)
        patch.setattr(csv_rows, "plain_text", lambda *_: None)
        text = load(path)
    assert fast.problems == text.problems
    assert fast.size == text.size
    for index in (0, 1):
        np.testing.assert_array_equal(fast.numbers[index], text.numbers[index])


def test_the_heavy_packages_are_not_imported_to_read_a_small_file(recording, save):
    code = (
        "import sys; from clutchid.measurements import read; read(sys.argv[1]);"
        "print(*{'polars', 'numba', 'sympy'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", code, str(save(recording()))]
    process = subprocess.run(command, capture_output=True, text=True, check=True)
    assert process.stdout.strip() == ""


def test_a_small_file_is_read_without_polars(recording, save, monkeypatch):
    monkeypatch.setattr(pl, "read_csv", None)
    log = cio.read(save(recording(3000, {(5, 1): "", **{(6, column): "" for column in range(1, 5)}})))
    assert (len(log), np.isnan(log["pressure_a"]).sum()) == (3000, 1)
