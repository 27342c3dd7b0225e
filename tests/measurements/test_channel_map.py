"""Channel maps as files: what is written is read again, and everything wrong with one is told at once."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.errors import DataError, ParameterError
from clutchid.log.units import known_units
from clutchid.measurements.columns import QUANTITIES
from clutchid.measurements.map.channel_map import Channel, ChannelMap, read_map, write_map
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_channel_map")

numbers = st.floats(-1e9, 1e9, allow_nan=False)


def channels(quantity):
    """Channels of a quantity, in any unit that it may have."""
    return st.builds(
        Channel, st.text(min_size=1), st.none() | st.text(), st.none() | st.sampled_from(known_units(quantity)),
        st.sampled_from([1.0, -1.0]), numbers.filter(bool), numbers, st.floats(-0.5, 0.5),
        st.none() | st.floats(1e-3, 1e3),
    )  # fmt: skip


entries = st.one_of([st.tuples(st.just(name), channels(QUANTITIES[name])) for name in sorted(QUANTITIES)])


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.lists(entries, min_size=1, max_size=8),
    st.none() | st.floats(1e-5, 10.0),
    st.none() | st.floats(1.0, 1e5),
    st.lists(st.sampled_from(["a.dbc", "ü.dbc"])),
)
def test_what_is_written_is_read_again(tmp_path_factory, items, raster, rate, dbc):
    folder = tmp_path_factory.mktemp("map")
    content = ChannelMap(
        dict(items), tuple(folder / name for name in dbc), raster, None if "time" in dict(items) else rate
    )
    write_map(content, folder / "MAP.toml")
    assert read_map(folder / "MAP.toml") == content


@pytest.mark.parametrize(("text", "problem"), CASES["maps"])
def test_a_map_that_cannot_be_is_a_problem(save, text, problem):
    with pytest.raises(ParameterError) as caught:
        read_map(save(text, "MAP.toml"))
    assert problem in str(caught.value)


def test_all_problems_are_reported_together(save):
    path = save(
        "raster = -1\ndbc = 3\nposition = 4\n[positon]\nchannel = 'x'\n[time]\nchanel = 't'\n[pressure_a]\n"
        "channel = 'p'\nunit = 'mm'\nsign = 2\nfactor = 0\nlongest = 0\n[duty_supply]\nchannel = 1\noffset = nan\n",
        "MAP.toml",
    )
    with pytest.raises(ParameterError) as caught:
        read_map(path)
    for part in (
        "12 problems",
        "raster = -1: an interval above 0 in s",
        "dbc = 3: a list of file names",
        "[position]: write a table",
        "no quantity 'positon'; did you mean 'position'?",
        "no entry of [time] 'chanel'; did you mean 'channel'?",
        "[time] channel: a string is needed",
        "[pressure_a] unit = 'mm': is not known here; use one of Pa,",
        "sign = 2: must be 1 or -1",
        "factor = 0: must be finite and not 0",
        "longest = 0: must be above 0 s",
        "[duty_supply] channel = 1: a string",
        "offset = nan: a finite number",
    ):
        assert part in str(caught.value)


def test_one_dbc_may_be_named_without_a_list(save, tmp_path):
    channel_map = read_map(save("dbc = 'a.dbc'\n[position]\nchannel = 'y'\n", "MAP.toml"))
    assert channel_map.dbc == (tmp_path / "a.dbc",)


def test_a_map_that_is_no_file_is_a_problem(tmp_path):
    with pytest.raises(DataError, match="there is no such file"):
        read_map(tmp_path / "NO.toml")
    with pytest.raises(DataError, match="name one channel map in it"):
        read_map(tmp_path)
