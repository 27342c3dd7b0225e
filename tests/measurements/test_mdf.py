"""MDF: files built byte by byte here, files of asammdf, real loggers' files, and what is left of them after damage."""

import contextlib
import struct
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from clutchid.errors import DataError, ExportError
from clutchid.log import Log
from clutchid.measurements.formats.can.mf4 import mdf_frames
from clutchid.measurements.formats.mdf.file import open_file, save
from clutchid.measurements.source import BLOCK
from fixtures.cases import case_tables
from fixtures.sources import joined, spoiled, tables_of

CASES = case_tables(__file__, "test_mdf")

pytest.importorskip("asammdf", reason="reading MDF needs asammdf: pip install '.[mdf]'")


class Bytes:
    """An MDF 4.10 file, block by block."""

    def __init__(self, magic=b"MDF     ", flags=0):
        self.data = bytearray(168)
        struct.pack_into("<8s8s8s4xH30xHH", self.data, 0, magic, b"4.10    ", b"test    ", 410, flags, 0)

    def add(self, name, links=(), body=b""):
        address = len(self.data)
        head = struct.pack("<4s4xQQ", name, 24 + 8 * len(links) + len(body), len(links))
        self.data += head + struct.pack(f"<{len(links)}Q", *links) + body
        self.data += bytes(-len(self.data) % 8)
        return address

    def text(self, text):
        return self.add(b"##TX", body=text.encode() + b"\0")

    def linear(self, offset, factor):
        return self.add(b"##CC", (0, 0, 0, 0), struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0, 0, offset, factor))

    def channel(self, name, following, kind, byte, size, *, role=0, bit=0, flags=0, conversion=0, invalid=0, sync=0):
        body = struct.pack("<BBBBIIII", role, sync or (role in (2, 3)), kind, bit, byte, size, flags, invalid)
        links = (following, 0, self.text(name), 0, conversion, 0, 0, 0)
        return self.add(b"##CN", links, body + struct.pack("<BBH6d", 0, 0, 0, *[0.0] * 6))

    def group(self, channel, cycles, size, *, following=0, number=0, flags=0, invalid=0, name=""):
        links = (following, channel, self.text(name) if name else 0, 0, 0, 0)
        return self.add(b"##CG", links, struct.pack("<QQHHIII", number, cycles, flags, 0, 0, size, invalid))

    def finish(self, group, records, *, id_size=0, lost=False):
        """The file with one data group, data last; without its length and count where the logger lost its power."""
        dg = self.add(b"##DG", (0, group, 0, 0), struct.pack("<B7x", id_size))
        struct.pack_into("<Q", self.data, dg + 40, len(self.data))
        self.add(b"##DT", body=b"" if lost else records)
        self.data += records if lost else b""
        head = struct.pack("<4s4xQQ6Q", b"##HD", 104, 6, dg, 0, 0, 0, 0, 0)
        self.data[64:168] = head + struct.pack("<QhhBBBBdd", 0, 0, 0, 0, 0, 0, 0, 0, 0)
        return bytes(self.data)


def two_channels(file, **more):
    """Time as a double at byte 0 and a signed 12-bit position in 0.01 mm from bit 4 of byte 8."""
    position = file.channel("Position", 0, 2, 8, 12, bit=4, conversion=file.linear(0.5, 0.01), **more)
    return file.channel("t", position, 4, 0, 64, role=2)


def records_of(count, first=b""):
    """Records at 1 kHz whose raw position counts down from 0; `first` stands before each."""
    return b"".join(first + struct.pack("<dh", i / 1000, -i * 16) for i in range(count))


def every(path, raster=0, rows=None):
    """All channels of a raster as one array each."""
    source = open_file(path)
    assert source.problems == ()
    return list(joined(tables_of(source, rows, raster)).values())


@pytest.fixture
def small(save):
    """A sound file of 9 samples."""
    file = Bytes()
    return save(file.finish(file.group(two_channels(file), 9, 10, name="motion"), records_of(9)), "run.mf4")


def test_a_long_log_is_written_and_read_in_blocks_that_count_on(tmp_path, monkeypatch):
    monkeypatch.setattr("clutchid.measurements.formats.mdf.file.BLOCK", 1000)
    time = np.arange(2500) / 1000
    log = Log(time, {"position": np.sin(time), "duty_supply": np.cos(time)}, "run")
    save(log, tmp_path / "run.mf4")
    source = open_file(tmp_path / "run.mf4")
    assert (source.problems, source.warnings, source.format, source.rasters[0].name) == ((), (), "MDF 4.10", "run")
    parts = list(source.tables(0, [1], 993))
    assert [(part.size, part.places.number(0)) for part in parts] == [(993, 1), (993, 994), (514, 1987)]
    assert np.array_equal(np.concatenate([part.numbers[1] for part in parts]), log["position"])


def test_the_start_of_the_measurement_is_in_the_header_for_other_programs(tmp_path):
    import asammdf

    start = {"start": "2024-05-01T12:00:00+02:00"}
    save(Log(np.zeros(1), {"position": np.zeros(1)}, metadata=start), tmp_path / "a.mf4")
    with asammdf.MDF(tmp_path / "a.mf4") as mdf:
        assert mdf.header.start_time.isoformat() == "2024-05-01T12:00:00+02:00"


def test_a_log_without_a_column_is_not_written(tmp_path):
    with pytest.raises(ExportError, match="no column beside the time"):
        save(Log(np.zeros(1), {}), tmp_path / "run.mf4")


def test_a_value_of_12_bits_becomes_physical(small):
    source = open_file(small)
    (raster,) = source.rasters
    assert (raster.name, raster.size, raster.clock) == ("motion", 9, 0)
    assert [(h.text, h.name, h.unit) for h in raster.headings] == [("t", None, "s"), ("Position", "position", None)]
    time, position = every(small, rows=4)
    assert np.array_equal(time, np.arange(9) / 1000)
    assert np.array_equal(position, np.arange(0, -9, -1) * 0.01 + 0.5)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(min_size=8, max_size=8), swapped=st.booleans(), signed=st.booleans(), cut=st.data())
def test_bits_of_a_record_are_the_integer_that_python_makes_of_them(save, data, swapped, signed, cut):
    bit = cut.draw(st.integers(0, 7))
    size = cut.draw(st.integers(1, 64 - bit))
    file = Bytes()
    value = file.channel("Value", 0, 2 * signed + swapped, 8, size, bit=bit)
    group = file.group(file.channel("t", value, 4, 0, 64, role=2), 1, 16)
    whole = int.from_bytes(data[: (bit + size + 7) // 8], "big" if swapped else "little")
    expected = (whole >> bit) % 2**size
    if signed and expected >= 2 ** (size - 1):
        expected -= 2**size
    assert every(save(file.finish(group, bytes(8) + data), "run.mf4"))[1] == [float(expected)]


def test_an_invalid_sample_is_missing(save):
    file = Bytes()
    group = file.group(two_channels(file, flags=2, invalid=1), 4, 10, invalid=1)
    marks = [0b00, 0b10, 0b01, 0b11]
    records = b"".join(struct.pack("<dhB", i / 1000, 16, mark) for i, mark in enumerate(marks))
    _, position = every(save(file.finish(group, records), "run.mf4"))
    assert np.array_equal(position, [0.51, np.nan, 0.51, np.nan], equal_nan=True)


def test_records_of_two_groups_that_are_mixed_are_sorted(save):
    file = Bytes()
    other = file.group(two_channels(file), 2, 10, number=2, name="b")
    first = file.group(two_channels(file), 3, 10, number=1, name="a", following=other)
    a, b = struct.pack("<Bdh", 1, 0.5, 16), struct.pack("<Bdh", 2, 0.25, 32)
    path = save(file.finish(first, a + b + a + a + b, id_size=1), "run.mf4")
    assert [(raster.name, raster.size) for raster in open_file(path).rasters] == [("a", 3), ("b", 2)]
    assert np.array_equal(every(path, 0)[0], [0.5] * 3)
    assert np.array_equal(every(path, 1, rows=1)[1], [0.52] * 2)


@pytest.mark.parametrize("mixed", [False, True])
def test_a_file_whose_logger_lost_power_keeps_its_whole_records(save, mixed):
    file = Bytes(b"UnFinMF ", flags=5)
    group = file.group(two_channels(file), 0, 10, number=1 if mixed else 0)
    records = records_of(7, b"\x01" if mixed else b"")
    path = save(file.finish(group, records[:-3], id_size=int(mixed), lost=True), "run.mf4")
    before = path.read_bytes()
    time, position = every(path)
    assert path.read_bytes() == before
    assert np.array_equal(time, np.arange(6) / 1000)
    assert np.array_equal(position, np.arange(0, -6, -1) * 0.01 + 0.5)


def test_stamps_may_be_counted_instead_of_stored(save):
    file = Bytes()
    position = file.channel("Position", 0, 1, 0, 16)  # unsigned, high byte first
    clock = file.channel("t", position, 0, 0, 0, role=3, conversion=file.linear(2.0, 0.125))
    path = save(file.finish(file.group(clock, 5, 2), struct.pack(">5H", *range(5))), "run.mf4")
    time, position = every(path, rows=2)
    assert np.array_equal(time, 2.0 + 0.125 * np.arange(5))
    assert np.array_equal(position, np.arange(5))


def test_a_master_that_counts_degrees_is_no_clock(save):
    file = Bytes()
    angle = file.channel("phi", file.channel("Position", 0, 0, 8, 16), 4, 0, 64, role=2, sync=2)
    (raster,) = open_file(save(file.finish(file.group(angle, 2, 10), records_of(2)), "run.mf4")).rasters
    assert (raster.clock, len(raster.headings)) == (None, 2)


def test_raw_bus_frames_are_no_raster_but_told(save):
    file = Bytes()
    frame = file.channel("CAN_DataFrame", 0, 10, 8, 16, flags=1 << 10)
    group = file.group(file.channel("t", frame, 4, 0, 64, role=2), 2, 10, flags=6)
    source = open_file(save(file.finish(group, records_of(2)), "run.mf4"))
    assert source.rasters == ()
    assert source.warnings == ("left out 1 group of raw bus frames; give their DBC with --dbc.",)


def test_signals_that_a_logger_decoded_beside_the_frame_are_kept(save):
    file = Bytes()
    speed = file.channel("Speed", 0, 0, 8, 16)
    frame = file.channel("CAN_DataFrame", speed, 10, 8, 16, flags=1 << 10)
    group = file.group(file.channel("t", frame, 4, 0, 64, role=2), 2, 10, flags=2)
    (raster,) = open_file(save(file.finish(group, records_of(2)), "run.mf4")).rasters
    assert [heading.text for heading in raster.headings] == ["t", "Speed"]


def test_a_file_without_frames_or_no_mdf_at_all_holds_no_bus_frames(small, save):
    assert mdf_frames(small) is None
    assert mdf_frames(save(b"", "empty.mf4")) is None
    assert mdf_frames(save(small.read_bytes()[:200], "cut.mf4")) is None


def test_groups_without_samples_and_channels_that_are_no_numbers_are_left_out_and_counted(save):
    file = Bytes()
    empty = file.group(two_channels(file), 0, 10, number=2)
    text = file.channel("Name", 0, 7, 8, 16)
    outside = file.channel("Beyond", text, 0, 9, 16)
    never = file.channel("Never", outside, 0, 8, 16, flags=1)
    position = file.channel("Position", never, 0, 8, 16)
    full = file.group(file.channel("t", position, 4, 0, 64, role=2), 2, 10, number=1, following=empty)
    source = open_file(save(file.finish(full, records_of(2, b"\x01"), id_size=1), "run.mf4"))
    assert [[heading.text for heading in raster.headings] for raster in source.rasters] == [["t", "Position"]]
    assert source.warnings == (
        "left out 1 group without samples.",
        "left out channels without numbers (3): 'Never' (no valid sample), 'Beyond' (bytes beyond its record), 'Name' "
        "(text).",
    )


@pytest.mark.parametrize(
    ("version", "apart"),
    [("2.14", False), ("3.30", False), ("4.00", False), ("4.10", False), ("4.20", False), ("4.20", True)],
)
def test_files_of_asammdf_give_what_its_own_conversion_gives(tmp_path, version, apart):
    import asammdf

    time, kinds = np.arange(50) / 100, ("u1", "i1", "<u2", ">u2", "<i4", ">i4", "<f4", ">f4", "<f8", ">f8")
    numbers = np.random.default_rng(5).integers(0, 100, 50)
    signals = [asammdf.Signal(numbers.astype(kind), time, name=kind, unit="bar") for kind in kinds]
    rules = {
        "linear": {"a": 0.1, "b": -3.0},
        "rational": {"P1": 0, "P2": 2, "P3": 1, "P4": 0, "P5": 0.5, "P6": 4},
        "curve": {"raw_0": 0, "phys_0": 1, "raw_1": 100, "phys_1": 5, "interpolation": True},
    }
    if version < "4":  # asammdf does not write the other rules to MDF 3
        rules = {name: rules[name] for name in ("linear", "rational")}
    signals += [asammdf.Signal(numbers.astype("u1"), time, name=n, conversion=rule) for n, rule in rules.items()]
    path = tmp_path / "run.mf4"
    with asammdf.MDF(version=version, **({"column_storage": True} if apart else {})) as mdf:
        mdf.append(signals, common_timebase=True)
        path = mdf.save(path)
    (raster,) = open_file(path).rasters
    assert [heading.unit for heading in raster.headings[:3]] == ["s", "bar", "bar"]
    columns = dict(zip([heading.text for heading in raster.headings], every(path, rows=7), strict=True))
    assert np.array_equal(columns["time"], time)
    for kind in kinds:
        assert np.array_equal(columns[kind], numbers)
    with asammdf.MDF(path) as mdf:
        for name in rules:  # the order of the operations differs, each rounds once
            np.testing.assert_allclose(columns[name], mdf.get(name).samples, rtol=8 * np.finfo(float).eps)


def numeric(mdf, group):
    """The channels of a group that asammdf gives as one number a sample, by their names."""
    channels = enumerate(mdf.groups[group].channels)
    samples = {channel.name: mdf.get(None, group, i).samples for i, channel in channels}
    return {name: values for name, values in samples.items() if values.ndim == 1 and values.dtype.kind in "uif"}


def test_files_of_many_versions_give_in_pieces_what_asammdf_gives_as_a_whole(data, tmp_path):
    import asammdf

    folder = data("foreign_files/asammdf_old")
    with zipfile.ZipFile(folder / "v0_test.demo.zip") as archive:
        archive.extractall(tmp_path)
    paths = [*(path for path in folder.iterdir() if path.read_bytes()[:3] == b"MDF"), *tmp_path.iterdir()]
    assert len(paths) == 16
    for path in paths:
        source = open_file(path)
        with asammdf.MDF(path) as mdf:
            groups = [mdf.virtual_groups_map[i] for i, group in enumerate(mdf.groups) if group.channel_group.cycles_nr]
            for number, (raster, group) in enumerate(zip(source.rasters, groups, strict=True)):
                theirs = numeric(mdf, group)
                ours = dict(zip([h.text for h in raster.headings], every(path, number, rows=100), strict=True))
                assert {name for name, _ in raster.others}.isdisjoint(ours)
                assert theirs.keys() <= ours.keys()
                for name, values in theirs.items():
                    place = f"{path} {name}"
                    np.testing.assert_allclose(ours[name], values.astype(float), rtol=1e-6, err_msg=place)


def texts_for_values(file, texts, default=0):
    """A conversion of the value i to the text i; the last value is 255."""
    values = [*range(len(texts) - 1), 255]
    links = (0, 0, 0, 0, *map(file.text, texts), default)
    head = struct.pack("<BBHHHdd", 7, 0, 0, len(texts) + 1, len(texts), 0, 0)
    return file.add(b"##CC", links, head + struct.pack(f"<{len(texts)}d", *values))


def with_values(file, save, channel, numbers):
    """A file with a channel of one byte."""
    group = file.group(file.channel("t", channel, 4, 0, 64, role=2), len(numbers), 9)
    return save(file.finish(group, b"".join(struct.pack("<dB", i, value) for i, value in enumerate(numbers))), "a.mf4")


def test_texts_for_values_are_missing_where_a_rule_gives_the_other_values(save):
    file = Bytes()
    gear = file.channel("Gear", 0, 0, 8, 8, conversion=texts_for_values(file, ["none"], file.text("in between")))
    slip_rule = texts_for_values(file, ["not available"], file.linear(0.0, 0.4))
    slip = file.channel("Slip", gear, 0, 8, 8, conversion=slip_rule)
    path = with_values(file, save, slip, (0, 10, 255))
    source = open_file(path)
    assert source.warnings == ("left out channels without numbers (1): 'Gear' (text).",)
    assert source.rasters[0].others == (("Gear", "text"),)
    _, slip = every(path)
    assert np.array_equal(slip, [0.0, 4.0, np.nan], equal_nan=True)


@pytest.mark.parametrize(("texts", "readable"), CASES["an_on_and_an_off_are_one_and_zero_and_other_texts_are_named"])
def test_an_on_and_an_off_are_one_and_zero_and_other_texts_are_named(save, texts, readable):
    file = Bytes()
    channel = file.channel("Valve", 0, 0, 8, 8, conversion=texts_for_values(file, texts))
    path = with_values(file, save, file.channel("Other", channel, 0, 8, 8), (0, 1, 255, 7))
    (raster,) = open_file(path).rasters
    assert raster.others == (() if readable else (("Valve", "text"),))
    if readable:
        expected = [0.0, 1.0, np.nan, np.nan] if len(texts) == 3 else [0.0, np.nan, 1.0, np.nan]
        assert np.array_equal(every(path)[2], expected, equal_nan=True)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_switches_texts_and_arrays_of_files_of_asammdf_are_told_apart(tmp_path, version):
    import asammdf

    time = np.arange(3) / 10
    numbers = np.array([0, 1, 2], dtype="u1")
    rules = {"Valve": [b"Off", b"On", b"Fault"], "Mode": [b"eco", b"sport", b"snow"]}
    signals = []
    for name, texts in rules.items():
        rule = {f"val_{i}": i for i in range(3)} | {f"text_{i}": text for i, text in enumerate(texts)}
        signals.append(asammdf.Signal(numbers, time, name=name, conversion=rule))
    signals.append(asammdf.Signal(np.array([b"a", b"b", b"c"]), time, name="Note", encoding="utf-8"))
    with asammdf.MDF(version=version) as mdf:
        mdf.append(signals, common_timebase=True)
        path = mdf.save(tmp_path / "run.mf4")
    (raster,) = open_file(path).rasters
    assert [heading.text for heading in raster.headings] == ["time", "Valve"]
    assert raster.others == (("Mode", "text"), ("Note", "text"))
    assert np.array_equal(every(path)[1], [0.0, 1.0, np.nan], equal_nan=True)


@pytest.mark.parametrize("where", ["clock", "channel", "default of texts"])
def test_a_formula_is_named_and_never_evaluated(save, tmp_path, where):
    file, proof = Bytes(), tmp_path / "proof"
    text = f"__import__('pathlib').Path('{proof}').touch() or X"
    rule = file.add(b"##CC", (0, 0, 0, 0, file.text(text)), struct.pack("<BBHHHdd", 3, 0, 0, 1, 0, 0, 0))
    rule = texts_for_values(file, ["none"], rule) if where == "default of texts" else rule
    last = file.channel("One", 0, 0, 8, 8)
    if where != "clock":
        last = file.channel("Spoiled", last, 0, 8, 8, conversion=rule)
    clock = file.channel("t", last, 4, 0, 64, role=2, conversion=rule if where == "clock" else 0)
    group = file.group(clock, 2, 9)
    path = save(file.finish(group, struct.pack("<dBdB", 0, 1, 1, 2)), "run.mf4")
    (raster,) = open_file(path).rasters
    assert raster.clock == (None if where == "clock" else 0)
    held = "text" if where == "default of texts" else "raw values and a formula"
    assert raster.others == (("t" if where == "clock" else "Spoiled", held),)
    assert np.array_equal(every(path)[-1], [1.0, 2.0])
    assert not proof.exists()


def test_entities_of_a_comment_are_not_unfolded(save):
    file = Bytes()
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    text = f'<!DOCTYPE HDcomment [<!ENTITY l0 "ha">{laughs}]><HDcomment><TX>&l9;</TX></HDcomment>'
    comment = file.add(b"##MD", body=text.encode() + b"\0")
    data = bytearray(file.finish(file.group(two_channels(file), 2, 10), records_of(2)))
    struct.pack_into("<Q", data, 64 + 24 + 5 * 8, comment)
    source = open_file(save(bytes(data), "run.mf4"))
    assert source.problems == ()
    assert len(source.metadata.get("comment", "")) < 1000


def test_a_file_that_is_cut_anywhere_is_refused_in_one_sentence(small):
    whole = small.read_bytes()
    for end in (*range(0, len(whole) - 6, 9), len(whole) - 7):  # the last 6 bytes only fill up to a multiple of 8
        small.write_bytes(whole[:end])
        source = open_file(small)
        (problem,) = source.problems
        assert source.rasters == ()
        assert (problem.count(". "), problem[-1]) == (0, ".")


def test_a_group_cannot_claim_more_samples_than_the_file_holds(save):
    file = Bytes()
    path = save(file.finish(file.group(two_channels(file), 10**15, 10), records_of(2)), "run.mf4")
    with pytest.raises(DataError, match="is cut off: group 1 should have 1000000 samples and has 2; copy it again"):
        list(open_file(path).tables(0, [0], 10**6))


def test_a_file_that_is_damaged_between_opening_and_reading_is_refused(small):
    source = open_file(small)
    small.write_bytes(small.read_bytes()[:-20])
    with pytest.raises(DataError, match="is cut off"):
        list(source.tables(0, [1]))


@pytest.mark.slow
def test_a_packed_block_that_cannot_be_unpacked_gives_no_numbers(tmp_path):
    path = tmp_path / "run.mf4"
    time = np.arange(BLOCK) / 1000
    save(Log(time, {"position": np.random.default_rng(3).random(BLOCK)}), path)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 1000] = bytes(1000)
    path.write_bytes(data)
    tables = open_file(path).tables(0, [1], 1000)
    with pytest.raises(DataError, match=r"is damaged within samples \d{3},001 to \d{3},000; copy it again"):
        assert all(np.isfinite(table.numbers[1]).all() for table in tables)


def test_every_real_log_opens_and_says_that_it_holds_frames(bus_logs):
    told = {}
    for path in sorted(bus_logs.glob("*.MF4")):
        source = open_file(path)
        assert (source.problems, source.rasters) == ((), ())
        assert mdf_frames(path) is not None
        told[path.stem] = (source.warnings, source.metadata["start"])
    assert told["css_truck_stationary_J1939"] == (
        ("left out 2 groups of raw bus frames; give their DBC with --dbc.", "left out 59 groups without samples."),
        "2023-11-30T17:02:04+00:00",
    )
    assert told["css_FCBF0606_J1939_small"][0][1] == "left out 1 group without samples."
    assert told["css_94C49784_nmea"][0][1] == "left out 7 groups without samples."


def test_spoiled_files_end_in_sentences(small, tmp_path, capfd):
    save(Log(np.arange(50) / 1000, {"position": np.arange(50.0)}), tmp_path / "packed.mf4")
    originals = [small.read_bytes(), (tmp_path / "packed.mf4").read_bytes()]
    for seed in range(200):
        small.write_bytes(spoiled(originals[seed // 4 % 2], seed))
        source = open_file(small)
        assert all("\n" not in problem and len(problem) < 300 for problem in source.problems)
        for number, raster in enumerate(source.rasters):
            with contextlib.suppress(DataError):
                assert sum(table.size for table in tables_of(source, 16, number)) == raster.size
    assert capfd.readouterr() == ("", "")
