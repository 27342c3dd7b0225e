"""`look` tells what is in a file, good or bad."""

import math
from dataclasses import replace

import polars as pl
import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.measurements import read
from clutchid.measurements.look import look
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from clutchid.measurements.opening import open_source


def test_columns_are_shown_as_written_and_in_si(recording, save):
    text = recording(4, {(1, 4): "", (2, 4): "7.905"}).replace("[Pa]", "[bar(g)]").replace("150000.0", "0")
    seen = look(save(text))
    pressure = seen.rasters[0].columns[4]
    named = (pressure.heading, pressure.name, pressure.unit, pressure.si)
    assert named == ("pressure_a [bar(g)]", "pressure_a", "bar(g)", "Pa")
    assert (pressure.low, pressure.high, pressure.low_si, pressure.high_si) == (0.0, 7.905, 1.013e5, 8.918e5)
    assert pressure.missing == 1
    assert look(save(text), 1e5).rasters[0].columns[4].low_si == 1e5
    assert seen.rasters[0].samples == 4
    assert seen.problems == seen.warnings == ()


def test_the_time_axis_is_measured(recording, save):
    seen = look(save(recording(10, {(8, 0): "0.500", (9, 0): "0.5015"})))
    time = seen.rasters[0].time
    assert (time.first, time.last, time.duration, time.hole_count) == (0.0, 0.5015, 0.5015, 1)
    assert (time.rate, time.longest, time.shortest) == pytest.approx((1000, 0.493, 0.001))
    (hole,) = time.holes
    assert (hole.place, hole.start, hole.length) == (9, 0.007, pytest.approx(0.493))
    assert "Gaps: 0.493 s after line 9" in str(seen)


@pytest.mark.parametrize("small", [0, 1e9])
def test_columns_without_a_meaning_are_looked_at_too(recording, save, small, monkeypatch):
    monkeypatch.setattr("clutchid.measurements.formats.csv.file._SMALL", small)
    text = recording(3).replace("\n", ",20,low\n").replace(",20,low", ",oil [degC],state", 1)
    seen = look(save(text))
    oil, state = seen.rasters[0].columns[5:]
    assert (oil.name, oil.si, oil.high, oil.high_si) == (None, "K", 20.0, 293.15)
    assert state.missing == 3
    assert math.isnan(state.high)
    assert seen.problems == ()
    assert "(ignored)" in seen.table()


@pytest.mark.parametrize("mapped", [False, True])
def test_a_spoiled_cell_of_a_column_that_is_not_read_is_no_problem(recording, save, mapped):
    head, *rows = recording(20).splitlines()
    rows = [f"{row},{'x' if i == 7 else i}" for i, row in enumerate(rows)]
    path = save("\n".join([f"{head},gear [1]", *rows]) + "\n")
    names = ("position [m]", "duty_supply [1]", "duty_exhaust [1]")
    channels = ChannelMap({name.partition(" ")[0]: Channel(name) for name in names}) if mapped else None
    assert len(read(path, channels=channels)) == 20
    seen = look(path, channels=channels)
    assert seen.problems == ()
    assert seen.rasters[0].columns[5].missing == 1


def test_problems_and_warnings_are_listed_not_raised(save):
    seen = look(save("time [s],position [furlong],duty_supply [1]\n0,1,\n1,x,0\n0,1,0\n"))
    assert len(seen.problems) == 3
    assert len(seen.warnings) == 2
    assert seen.rasters[0].columns[1].si is None
    assert seen.rasters[0].columns[1].high == 1.0
    assert seen.rasters[0].time.shortest == -1.0
    assert all(text in seen.table() for text in ("Problems:", *seen.problems, *seen.warnings))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "the file is empty"),
        (b"\xff\xfe\x00", "not UTF-8"),
        (b"PAR1 and nothing else", "not a complete Parquet file"),
        ("time [s],position [m]\n", "no samples"),
    ],
)
def test_a_file_without_samples_is_a_list_of_problems(save, content, problem):
    seen = look(save(content))
    assert any(problem in sentence for sentence in seen.problems)
    assert all(raster.samples == 0 and raster.time is None for raster in seen.rasters)
    assert any(words in str(seen) for words in ("no time axis", "0 time grids"))


def test_a_file_without_names_says_so_and_shows_its_columns(save):
    seen = look(save("1,2.5\n3,4.5\n"))
    assert any("the first line contains numbers" in sentence for sentence in seen.problems)
    shown = [(column.heading, column.high) for column in seen.rasters[0].columns]
    assert shown == [("column 1", 3.0), ("column 2", 4.5)]


def test_blank_lines_in_a_file_of_one_column_are_no_samples(save):
    seen = look(save("time [s]\n0\n\n1\n"))
    assert (seen.rasters[0].samples, seen.rasters[0].columns[0].missing) == (2, 0)


def test_one_sample_has_no_rate(recording, save):
    seen = look(save(recording(1)))
    assert seen.rasters[0].time.rate == 0.0
    assert str(seen).splitlines()[0].endswith("1 sample at 0 s")


def test_a_time_without_a_known_unit_is_no_axis(recording, save):
    assert look(save(recording(3).replace("[s]", "[fortnight]"))).rasters[0].time is None


def test_parquet_is_looked_at_by_row(tmp_path):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"time [s]": [0, 1, 2, 30], "gear": ["a", "b", "c", "d"]}).write_parquet(path)
    seen = look(path)
    assert all(words in str(seen) for words in ("28 s after row 3", "gear"))


def test_the_table_is_aligned(recording, save):
    table = look(save(recording(3))).table().splitlines()[2:8]
    assert table[0].split() == ["column", "as", "written", "from", "to", "in", "SI", "from", "to", "missing"]
    assert len({len(line) for line in table}) == 1


def test_a_long_name_is_whole_in_the_listing_and_in_the_map_and_narrow_in_the_table(save):
    name = "Vehicle.Powertrain.Transmission.ClutchActuator.PositionMeasured [mm]"
    seen = look(save(f"t [s],{name}\n0,1.5\n1,2.5\n"))
    assert seen.rasters[0].columns[1].heading == name
    assert seen.proposal.channels.channels["position"].channel == name
    assert name in seen.listing()
    (cells,) = [line for line in seen.table().splitlines() if "…" in line]
    assert len(cells) < 120


PLAIN = "n,Weg,gear\n" + "".join(f"{i * i},{i / 10},low\n" for i in range(100))


def test_mapped_channels_are_shown_as_mapped_with_their_time_and_findings(save):
    path = save(PLAIN)
    assert look(path).rasters[0].time is None
    entries = {"position": Channel("Weg", unit="mm", sign=-1.0, offset=20.0)}
    seen = look(path, channels=ChannelMap(entries, rate=200.0))
    _, weg, gear = seen.rasters[0].columns
    assert (weg.name, weg.unit, weg.low, weg.high) == ("position", "mm", 0.0, 9.9)
    assert (weg.low_si, weg.high_si) == pytest.approx((0.0101, 0.02))
    assert seen.rasters[0].time.rate == pytest.approx(200.0)
    assert gear.name is None
    assert "(text)" in seen.table()
    assert seen.problems == (
        "no channel is assigned to duty_supply, duty_exhaust; add [duty_supply] and [duty_exhaust] to the map.",
    )
    assert "Proposed channel map" not in seen.table()


def test_a_map_without_time_still_shows_its_channels(save):
    seen = look(save(PLAIN), channels=ChannelMap({"position": Channel("Weg", unit="mm")}))
    assert seen.rasters[0].columns[1].name == "position"
    assert any("defines no time axis" in problem for problem in seen.problems)


def test_the_repairs_of_read_are_shown_with_a_map(save):
    path = save("n,Weg,A,B\n" + "".join(f"{i - (i == 7)},{i / 10},{i % 2},0\n" for i in range(100)))
    entries = {"time": Channel("n", unit="ms"), "position": Channel("Weg", unit="mm")}
    entries |= {"duty_supply": Channel("A", unit="1"), "duty_exhaust": Channel("B", unit="1")}
    seen = look(path, channels=ChannelMap(entries))
    assert seen.problems == ()
    assert any("with the time stamp of an earlier one" in warning for warning in seen.warnings)
    assert seen.rasters[0].time.repeated == 1
    bad = look(path, channels=ChannelMap({**entries, "duty_supply": Channel("Weg", unit="1")}))
    assert any("is not a duty cycle" in problem for problem in bad.problems)


def test_a_clock_that_restarts_is_said_in_the_heading_in_place_of_a_negative_length(recording, save):
    rows = recording(200).splitlines()
    restarted = "\n".join([*rows, *rows[1:]]) + "\n"
    heading = str(look(save(restarted, "twice.csv"))).splitlines()[0]
    assert heading.endswith("400 samples from 0 s at 1000 Hz; the stamps go back once")


def test_a_map_of_a_test_rig_needs_no_duty_cycles(save):
    entries = {"position": Channel("Weg", unit="mm"), "force": Channel("n", unit="N")}
    assert look(save(PLAIN), channels=ChannelMap(entries, rate=100.0)).problems == ()


def test_channels_without_numbers_are_listed(save, monkeypatch):
    path = save(PLAIN)
    made = open_source(path)
    hidden = replace(made, rasters=(replace(made.rasters[0], others=(("state", "text"), ("image", "3 x 4 numbers"))),))
    monkeypatch.setattr("clutchid.measurements.look.open_source", lambda *_: hidden)
    seen = look(path)
    assert "Without numbers: 'state' (text), 'image' (3 x 4 numbers)" in seen.table()
    assert '"image"  # no numbers: 3 x 4 numbers' in seen.listing()


def test_only_a_file_that_cannot_be_opened_raises(tmp_path, recording, save):
    with pytest.raises(DataError, match="there is no such file"):
        look(tmp_path / "no.csv")
    with pytest.raises(ParameterError, match="ambient"):
        look(save(recording()), -1.0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"MDF     4.10".ljust(100), "is an MDF file that ends within its header, after 100 bytes; copy it again."),
        (bytes(range(256)), "is not a readable MDF file; copy it again."),
    ],
)
def test_a_broken_mdf_file_is_said_to_be_one_by_its_name(tmp_path, content, said):
    (tmp_path / "run.mf4").write_bytes(content)
    assert look(tmp_path / "run.mf4").problems == (f"run.mf4: {said}",)
