"""A file and a channel map made a recording."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements.columns import REQUIRED
from clutchid.measurements.conversion import pieces
from clutchid.measurements.formats.csv.file import open_file
from clutchid.measurements.map.channel_map import Channel, ChannelMap

FAST, SLOW = np.arange(2000) / 1000 + 0.0003, np.arange(200) / 100
VALVES = {"t": ("s", FAST), "Einlass": ("%", 100 * (FAST % 0.2 < 0.1)), "Auslass": ("1", 1.0 * (FAST % 0.2 >= 0.1))}
TRAVEL = {"t": ("s", SLOW), "Weg": ("mm", -2 * SLOW + 1)}
PRESSURE = {"t": ("ms", 1000 * SLOW + 4), "Druck": ("V", SLOW), "leer": (None, SLOW)}
MAP = ChannelMap({
    "position": Channel("Weg", sign=-1, offset=1.0), "duty_supply": Channel("einlass"),
    "duty_exhaust": Channel("Auslass"), "pressure_a": Channel("Druck", unit="bar(g)", factor=2.0, delay=0.004),
})  # fmt: skip
POSITION = ChannelMap({"position": MAP.channels["position"]})
TIME = ("time",)
WITHOUT_TIME = {"Weg": TRAVEL["Weg"]}


def read(made, channels=MAP, rows=None, required=REQUIRED):
    return list(pieces(made, channels, 1e5, required, rows))


def test_rasters_meet_on_the_stamps_of_the_quickest(source):
    (log,) = read(source(VALVES, TRAVEL, PRESSURE))
    assert np.array_equal(log.time, FAST)
    inside = SLOW[-1] > FAST
    assert np.array_equal(log["duty_supply"], (FAST % 0.2 < 0.1) * 1.0)
    assert np.allclose(log["position"][inside], 2e-3 * FAST[inside], rtol=0, atol=1e-12)
    assert np.isnan(log["position"][~inside]).all()
    assert np.allclose(log["pressure_a"][inside], 1e5 + 2e5 * FAST[inside], rtol=1e-12, atol=0)
    assert log.name == "day"


@pytest.mark.parametrize("rows", [7, 150, 3000])
def test_pieces_are_the_whole_cut(rows, source):
    (whole,) = read(source(VALVES, TRAVEL, PRESSURE))
    parts = read(source(VALVES, TRAVEL, PRESSURE), rows=rows)
    assert len(parts) == -(-2000 // rows)
    for name, values in (("time", whole.time), *whole.columns.items()):
        joined = np.concatenate([part.time if name == "time" else part[name] for part in parts])
        assert np.array_equal(joined, values, equal_nan=True), name


def test_a_raster_may_be_asked_for(source):
    (log,) = read(source(VALVES, TRAVEL), ChannelMap({n: MAP.channels[n] for n in REQUIRED[1:]}, raster=0.002))
    assert np.array_equal(log.time, FAST[::2])
    assert np.array_equal(log["duty_supply"], (FAST % 0.2 < 0.1)[::2] * 1.0)


def test_a_raster_that_is_asked_for_has_no_instants_in_a_hole(source):
    keep = (FAST < 0.5) | (FAST > 1.5)
    valves = {name: (unit, values[keep]) for name, (unit, values) in VALVES.items()}
    (log,) = read(source(valves, TRAVEL), ChannelMap({n: MAP.channels[n] for n in REQUIRED[1:]}, raster=0.001))
    assert not ((log.time > 0.501) & (log.time < 1.499)).any()
    assert log.time.size == keep.sum()


def test_a_duty_cycle_that_is_sent_on_change_holds_as_long_as_the_map_says(source):
    sent = {"t": ("s", np.array([0.0, 0.4, 1.1])), "Einlass": ("1", np.array([0, 1, 0])), "Auslass": ("1", [1, 0, 1])}
    made = source(sent, TRAVEL)
    longest = {"duty_supply": Channel("Einlass", longest=10.0), "duty_exhaust": Channel("Auslass", longest=10.0)}
    (log,) = read(made, ChannelMap({**POSITION.channels, **longest}))
    assert np.array_equal(log.time, SLOW)
    assert np.array_equal(log["duty_supply"], (SLOW >= 0.4) & (SLOW < 1.1))


def test_one_channel_may_be_two_quantities(source):
    """A 3/2 valve: what is not supplied is vented."""
    valve = {"t": ("s", SLOW), "Weg": ("mm", SLOW), "Ventil": ("1", (SLOW % 0.2 < 0.1) * 1.0)}
    entries = {"position": Channel("Weg"), "duty_supply": Channel("Ventil")}
    entries["duty_exhaust"] = Channel("Ventil", sign=-1, offset=1.0)
    (log,) = read(source(valve), ChannelMap(entries))
    assert np.array_equal(log["duty_supply"], valve["Ventil"][1])
    assert np.array_equal(log["duty_exhaust"], 1 - valve["Ventil"][1])


def test_every_misfit_of_the_map_is_told_at_once(source):
    twice = source(TRAVEL, TRAVEL, PRESSURE, {"x": ("1", SLOW), "y": ("1", SLOW)})
    wrong = {"position": "Weg", "duty_supply": "Einlas", "duty_exhaust": "leer", "pressure_a": "Druck"}
    with pytest.raises(DataError) as caught:
        read(twice, ChannelMap({name: Channel(text) for name, text in wrong.items()}))
    for part in (
        "position: 2 channels are called 'Weg'; name the group, one of 'group 0', 'group 1'.",
        "duty_supply: there is no channel 'Einlas'; `clutchid look` lists them.",
        "duty_exhaust: channel 'leer' has no unit; write unit = '...' in the map, one of 1, %.",
        "pressure_a: channel 'Druck' has the unit [V]; write unit",
    ):
        assert part in str(caught.value)


def test_without_stamps_the_map_has_to_name_them(source):
    table = {"n": (None, SLOW), "Weg": ("mm", SLOW), "a": ("1", 0 * SLOW), "b": ("1", 0 * SLOW)}
    entries = {"position": Channel("Weg"), "duty_supply": Channel("a"), "duty_exhaust": Channel("b")}
    with pytest.raises(DataError, match="defines no time axis for them; add \\[time\\]"):
        read(source(table, clock=False), ChannelMap(entries))
    (log,) = read(source(table, clock=False), ChannelMap({**entries, "time": Channel("n", unit="min")}))
    assert np.array_equal(log.time, SLOW * 60)


def test_what_the_map_lacks_is_named(source):
    words = r"no channel is assigned to duty_supply, duty_exhaust; add \[duty_supply\] and \[duty_exhaust\] to the map"
    with pytest.raises(DataError, match=words):
        read(source(TRAVEL), POSITION)
    (log,) = read(source(TRAVEL), POSITION, required=("position",))
    assert list(log.columns) == ["position"]


def test_bad_samples_are_told_with_their_row_and_stamps_are_mended(source):
    bad = {**VALVES, "Auslass": ("1", np.where(np.arange(2000) % 50 == 27, 3.0, 0.0))}
    with pytest.raises(DataError, match="column 'Auslass' is not a duty cycle: row 28 has 3"):
        read(source(bad, TRAVEL, PRESSURE))
    twice = [
        {name: (unit, np.r_[values, values]) for name, (unit, values) in group.items()}
        for group in (VALVES, TRAVEL, PRESSURE)
    ]
    (log,) = read(source(*twice))
    assert log.time.size == 4000
    assert any(w.startswith("group 0: the clock restarts at row 2001") for w in log.warnings)
    (once,) = read(source(VALVES, TRAVEL, PRESSURE))
    for name, values in once.columns.items():
        later = log[name][2100:], values[100:]
        assert np.allclose(*later, rtol=1e-9, atol=1e-12, equal_nan=True), f"{name}: one shift for all groups"
    with pytest.raises(DataError, match="restart 0 and 1 times, so it is unclear which samples belong together"):
        read(source(twice[0], TRAVEL, PRESSURE))


LONG = "Vehicle.Powertrain.Transmission.ClutchActuator.PositionMeasured [mm]"


@pytest.mark.parametrize("name", [LONG, LONG.partition(" [")[0], LONG.upper()])
def test_a_channel_with_a_long_name_is_mapped(source, name):
    travel = {"t": ("s", SLOW), LONG: ("mm", SLOW)}
    (log,) = read(source(travel), ChannelMap({"position": Channel(name)}), required=TIME)
    assert np.allclose(log["position"], 1e-3 * SLOW)


def test_an_exact_name_is_preferred_to_the_same_name_with_a_unit(source):
    travel = {"t": ("s", SLOW), "Weg [mm]": ("mm", SLOW), "Weg": ("mm", 2 * SLOW), "WEG": ("mm", 3 * SLOW)}
    (log,) = read(source(travel), ChannelMap({"position": Channel("Weg")}), required=TIME)
    assert np.allclose(log["position"], 2e-3 * SLOW)


def rated(**entries):
    return ChannelMap({n: MAP.channels[n] for n in ("position",)} | entries, rate=500.0)


@pytest.mark.parametrize("rows", [None, 30])
def test_a_file_without_time_gets_it_from_the_rate_of_the_map(source, rows):
    logs = read(source(WITHOUT_TIME, clock=False), rated(), rows, required=TIME)
    assert np.array_equal(np.concatenate([log.time for log in logs]), np.arange(200) / 500)
    assert np.allclose(np.concatenate([log["position"] for log in logs]), 2e-3 * SLOW)
    assert not any(log.warnings for log in logs)


@pytest.mark.parametrize(("name", "unit"), [("position(:,1)", "m"), ("position(:,1)", None), ("curve(:,1)", "m")])
def test_a_position_that_increases_is_no_time(source, name, unit):
    made = source({name: (unit, SLOW), **WITHOUT_TIME})
    with pytest.raises(DataError, match="the file defines no time axis"):
        read(made, POSITION, required=TIME)
    (log,) = read(made, rated(), required=TIME)
    assert log.time[1] == 2e-3


@pytest.mark.parametrize(
    ("name", "usual", "words"),
    [
        ("t", 1e-2, "'t' has no unit; [s] is guessed"),
        ("curve(:,1)", 1e-2, "'curve(:,1)' increases and is taken for time; [s] is guessed"),
        ("t_ms", 1e-5, "the unit [ms] is taken from the name of the channel 't_ms'"),
    ],
)
def test_a_guessed_unit_of_time_is_a_warning(source, name, usual, words):
    made = source({name: (None, SLOW), **WITHOUT_TIME})
    (log,) = read(made, POSITION, required=TIME)
    assert log.time[1] - log.time[0] == pytest.approx(usual)
    (warning,) = log.warnings
    assert words in warning


def test_a_unit_from_a_name_is_a_warning(source):
    (log,) = read(source({"t": ("s", SLOW), "x_mm": (None, SLOW)}), ChannelMap({"position": Channel("x_mm")}), None, ())
    assert np.allclose(log["position"], 1e-3 * SLOW)
    assert log.warnings == ("position: the unit [mm] is taken from the name of the channel 'x_mm'.",)


def test_a_channel_of_text_cannot_be_mapped(save):
    made = open_file(save("t [s],gear,y [mm]\n0,low,1\n1,high,2\n"))
    with pytest.raises(DataError, match="position: channel 'gear' holds text, not one number per sample; name another"):
        read(made, ChannelMap({"position": Channel("gear", unit="mm")}), required=TIME)


def test_a_channel_that_a_format_does_not_read_is_named_with_what_it_holds(source):
    made = source(TRAVEL)
    made = replace(made, rasters=(replace(made.rasters[0], others=(("image", "3 x 4 numbers"),)),))
    with pytest.raises(DataError, match="position: channel 'image' holds 3 x 4 numbers, not one number per sample"):
        read(made, ChannelMap({"position": Channel("image")}), required=TIME)


def test_duty_cycles_on_a_grid_of_their_own_keep_their_edges(source):
    valves = {"t": ("s", SLOW), "Einlass": ("%", 100 * (SLOW % 0.2 < 0.1)), "Auslass": ("1", 1.0 * (SLOW % 0.2 >= 0.1))}
    travel = {"t": ("s", FAST), "Weg": ("mm", -2 * FAST + 1)}
    channels = ChannelMap({name: MAP.channels[name] for name in REQUIRED[1:]})
    (log,) = read(source(valves, travel), channels)
    assert np.array_equal(log.time, FAST)
    stamps, values = log.edges["duty_supply"]
    assert np.array_equal(stamps, SLOW)
    assert np.array_equal(values, (SLOW % 0.2 < 0.1) * 1.0)
    assert not read(source({**valves, **TRAVEL}), channels)[0].edges, "in one table there are none"


STANDARD = {
    "time": ("ms", 1e3 * FAST),
    "gear": ("1", FAST),
    "position": ("mm", FAST),
    "duty_supply": ("%", 100 * (FAST % 0.2 < 0.1)),
    "duty_exhaust": ("1", 1.0 * (FAST % 0.2 >= 0.1)),
}


@pytest.mark.parametrize("rows", [None, 333])
def test_standard_names_are_read_as_a_map_that_names_them(source, rows):
    named = ChannelMap({name: Channel(name) for name in STANDARD if name != "gear"})
    with_map, without = read(source(STANDARD), named, rows), read(source(STANDARD), None, rows)
    assert len(with_map) == len(without) > (rows is not None)
    for mapped, other in zip(with_map, without, strict=True):
        np.testing.assert_array_equal(mapped.time, other.time)
        assert set(mapped.columns) == set(other.columns)
        for name in mapped.columns:
            np.testing.assert_array_equal(mapped[name], other[name])


def test_what_is_wrong_with_the_headings_is_said_with_the_first_piece_only(source):
    first, *others = read(source(STANDARD), None, 333)
    assert [warning.partition(" is unknown")[0] for warning in first.warnings] == ["column 'gear'"]
    assert len(others) == 6
    assert not any(log.warnings for log in others)


HUGE = {"t": ("s", SLOW), "Weg": ("m", np.full(SLOW.size, 1e300))}


@pytest.mark.parametrize(
    ("columns", "clock", "channels", "words"),
    [
        (
            {"t": ("s", SLOW), "Weg [mm]": ("mm", SLOW), "Weg [m]": ("m", SLOW)},
            True,
            ChannelMap({"position": Channel("Weg")}),
            r"write the whole name, one of 'Weg \[mm\]', 'Weg \[m\]'",
        ),
        (
            WITHOUT_TIME,
            False,
            rated(time=Channel("t")),
            r"rate = 500 Hz and \[time\] both define the time; keep one of them",
        ),
        (TRAVEL, True, rated(), "rate = 500 Hz: the file has a time channel, 't'; remove rate from the map"),
        (
            WITHOUT_TIME,
            False,
            POSITION,
            r"add \[time\] to the map, or the rate of the samples in Hz as `rate` above its first table",
        ),
        (HUGE, True, ChannelMap({"position": Channel("Weg", factor=1e300)}), "'Weg' is infinite in rows 1-200"),
        (HUGE, True, ChannelMap({"position": Channel("Weg", offset=1.7e308, factor=1e300)}), "infinite in rows 1-200"),
    ],
)
def test_a_file_and_a_map_that_do_not_fit_are_a_sentence(source, columns, clock, channels, words):
    with pytest.raises(DataError, match=words):
        read(source(columns, clock=clock), channels, required=("position",) if columns is HUGE else TIME)


@pytest.mark.parametrize("once", [False, True])
def test_a_duty_cycle_that_is_written_where_it_changes_is_held(source, once):
    time, dense = np.arange(4000) * 1e-3, np.zeros(4000)
    dense[300:340] = np.linspace(0.01, 0.4, 40)
    dense[340:2000], dense[2000:2050], dense[2050:] = 0.4, np.linspace(0.39, 0.0, 50), 0.0
    written = np.where(np.diff(dense, prepend=-1.0) != 0.0, dense, np.nan)
    exhaust = np.r_[0.25, np.full(3999, np.nan)] if once else written
    columns = {
        "time": ("s", time), "position": ("mm", 5.0 + np.sin(time)),
        "duty_supply": ("1", written), "duty_exhaust": ("1", exhaust),
    }  # fmt: skip
    (log,) = read(source(columns), MAP_BY_NAME)
    assert np.array_equal(log["duty_supply"], dense)
    assert np.array_equal(log["duty_exhaust"], np.full(4000, 0.25) if once else dense)
    assert np.allclose(log["position"], 1e-3 * (5.0 + np.sin(time)))
    assert "duty_supply: is recorded where it changes; each sample is held until the next one." in log.warnings
    assert not any("no samples" in sentence for sentence in log.warnings)


MAP_BY_NAME = ChannelMap({name: Channel(name) for name in ("time", "position", "duty_supply", "duty_exhaust")})
