"""CAN logs: frames of all three containers, sorted into messages and decoded."""

import random
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements.formats.can import file as can_file
from clutchid.measurements.formats.can import mf4
from clutchid.measurements.formats.can.file import frame_log, open_file
from clutchid.measurements.formats.can.frames import Frames, as_payload, merged
from fixtures.sources import numbers_of

can = pytest.importorskip("can", reason="python-can, of the extra can, writes the logs")
cantools = pytest.importorskip("cantools", reason="cantools, of the extra can, is the oracle")

START = 1.7e9
WRITERS = {"blf": can.BLFWriter, "asc": can.ASCWriter, "mf4": can.MF4Writer}

#: Half of the last digit that each format keeps of a stamp, and the rounding of a stamp of 1.7e9 s by the writer.
RESOLUTION = {"blf": 5e-10 + 3e-7, "asc": 5e-7 + 3e-7, "mf4": 3e-7}

TEXTS = Path(__file__).with_name("texts")
DBC, ASC, TRC = ((TEXTS / name).read_text() for name in ("bus.dbc", "run.asc", "run.trc"))


@pytest.fixture
def dbc():
    """A DBC with J1939 messages, a multiplexed one and a long one."""
    return TEXTS / "bus.dbc"


@pytest.fixture
def logged(tmp_path):
    """Write frames (stamp in s, identifier, payload, bus) to a log of the format."""

    def make(suffix, frames):
        if suffix == "mf4":
            pytest.importorskip("asammdf", reason="python-can writes MF4 with asammdf, of the extra mdf")
        path = tmp_path / f"log.{suffix}"
        writer = WRITERS[suffix](path)
        for stamp, identifier, payload, bus in frames:
            writer(message(stamp, identifier, payload, bus))
        writer.stop()
        return path

    return make


def message(stamp, identifier, payload=bytes(8), bus=0):
    long = len(payload) > 8
    extended = identifier > 0x7FF
    stamp, data = START + stamp, bytes(payload)
    return can.Message(stamp, identifier, extended, channel=bus, data=data, is_fd=long, dlc=len(data), is_rx=True)


def mixture(count=500, seed=0):
    """Frames of many kinds on two buses, 10 ms apart."""
    generator = random.Random(seed)
    kinds = [0x100, 0x101, 0x0CF00400, 0x18F00421, 0x0C00000B, 0x0C000F0B, 0x18EBFF00, 0x123]
    picked = [generator.choice(kinds) for _ in range(count)]
    sizes = [64 if identifier == 0x101 else 8 for identifier in picked]
    payloads = [generator.randbytes(size) for size in sizes]
    payloads = [bytes([payload[0] % 2]) + payload[1:] for payload in payloads]
    return [(i * 0.01, picked[i], payloads[i], generator.choice([0, 1])) for i in range(count)]


def frames_of(path):
    """All frames of a log, an array a field."""
    blocks = list(frame_log(path).blocks())
    names = ("stamp", "bus", "identifier", "extended", "length", "data")
    return {name: np.concatenate([getattr(block, name) for block in blocks]) for name in names}


def by_name(source):
    return {raster.name: numbers_of(source, index) for index, raster in enumerate(source.rasters)}


@pytest.mark.parametrize("suffix", WRITERS)
def test_frames_are_read_as_they_were_written(logged, suffix):
    frames = mixture()
    columns_of = frames_of(logged(suffix, frames))
    stamps = [frame[0] for frame in frames]
    np.testing.assert_allclose(
        columns_of["stamp"] - columns_of["stamp"][0], stamps, rtol=0, atol=2 * RESOLUTION[suffix]
    )
    columns = (columns_of[name].tolist() for name in ("identifier", "extended", "length", "bus"))
    read = [(i, long, bytes(row[:n]), bus) for row, i, long, n, bus in zip(columns_of["data"], *columns, strict=True)]
    first = 0 if suffix == "mf4" else 1  # BLF and ASC count buses from 1
    assert read == [(i, i > 0x7FF, payload, bus + first) for _, i, payload, bus in frames]


@pytest.mark.parametrize("suffix", WRITERS)
def test_every_message_is_decoded_as_cantools_does_it_one_by_one(logged, dbc, suffix):
    frames = mixture()
    source = open_file(logged(suffix, frames), [dbc])
    database = cantools.database.load_file(dbc)
    grids = by_name(source)
    first = 0 if suffix == "mf4" else 1
    for bus in (0, 1):
        for identifier, name, marks, page in (
            (0x100, "Clutch", "", None),
            (0x100, "Clutch", ", Mode=0", 0),
            (0x100, "Clutch", ", Mode=1", 1),
            (0x101, "Long", "", None),
            (0x0CF00400, "EEC1", ", from 0x00", None),
            (0x18F00421, "EEC1", ", from 0x21", None),
            (0x0C00000B, "TSC1", ", to 0x00", None),
            (0x0C000F0B, "TSC1", ", to 0x0F", None),
        ):
            taken = [f for f in frames if f[1] == identifier and f[3] == bus and (page is None or f[2][0] == page)]
            ours = grids.pop(f"{name} (CAN{bus + first}{marks})")
            np.testing.assert_allclose(
                ours.pop("time"), [frame[0] for frame in taken], rtol=0, atol=2 * RESOLUTION[suffix]
            )
            theirs = database.get_message_by_name(name)
            for signal, numbers in ours.items():
                expected = [theirs.decode(frame[2], decode_choices=False)[signal] for frame in taken]
                raw = [theirs.decode(frame[2], scaling=False)[signal] for frame in taken]
                bits = theirs.get_signal_by_name(signal).length
                missing = [name in {"EEC1", "TSC1"} and number >= 0xFE << (bits - 8) for number in raw]
                np.testing.assert_array_equal(numbers, np.where(missing, np.nan, expected))
    assert grids == {}


@pytest.mark.parametrize(("kind", "sent", "received"), [("S2", b"Tx", b"Rx"), ("S4", b"tx", b"rx"), ("u1", 1, 0)])
def test_an_mf4_log_says_in_numbers_or_in_texts_which_frames_were_sent(tmp_path, kind, sent, received):
    asammdf = pytest.importorskip("asammdf", reason="MF4 is written with asammdf, of the extra mdf")
    fields = [("ID", "<u4"), ("DataLength", "<u1"), ("DataBytes", "(8,)u1"), ("Dir", kind)]
    frames = np.zeros(4, dtype=[(f"CAN_DataFrame.{name}", of) for name, of in fields])
    frames["CAN_DataFrame.ID"], frames["CAN_DataFrame.DataLength"] = 0x123, 8
    frames["CAN_DataFrame.Dir"] = [received, sent, received, sent]
    source = asammdf.Source("CAN", "CAN", "", source_type=2, bus_type=2)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(asammdf.Signal(frames.view(np.recarray), 0.1 * np.arange(4), name="CAN_DataFrame", source=source))
        mdf.save(tmp_path / "run.mf4")
    (block,) = frame_log(tmp_path / "run.mf4").blocks()
    assert block.sent.tolist() == [False, True, False, True]


@pytest.mark.parametrize(
    ("suffix", "start"),
    [("blf", datetime(2023, 11, 14, 22, 13, 20, 250_000)), ("asc", datetime.fromtimestamp(START + 0.25))],
)
def test_the_start_of_the_log_is_the_time_of_its_first_frame(logged, dbc, suffix, start):
    # python-can writes the start of a BLF in UTC, that of an ASC in local time
    source = open_file(logged(suffix, [(0.25, 0x100, bytes(8), 0), (1.25, 0x100, bytes(8), 0)]), [dbc])
    written = datetime.fromisoformat(source.metadata["start"])
    assert abs((written - start).total_seconds()) <= 1e-3
    np.testing.assert_allclose(numbers_of(source, 0)["time"], [0, 1], rtol=0, atol=2 * RESOLUTION[suffix])
    assert source.metadata["dbc"] == "bus.dbc"


def test_channels_have_the_units_and_comments_of_the_dbc(logged, dbc):
    source = open_file(logged("blf", [(0, 0x100, bytes(8), 0), (1, 0x100, bytes(8), 0)]), [dbc])
    time, mode = source.rasters[0].headings
    assert (time.name, time.unit, source.rasters[0].clock, source.rasters[0].size) == ("time", "s", 0, 2)
    travel = source.rasters[1].headings[1]
    assert (mode.text, travel.text, travel.unit, travel.comment) == ("Mode", "Travel", "mm", "Of the release bearing")
    assert [raster.name for raster in source.rasters] == ["Clutch", "Clutch (Mode=0)"]


def test_priority_and_sender_do_not_matter_and_the_message_of_the_own_sender_comes_first(logged, tmp_path):
    own = DBC.replace("BO_ 2348810494 TSC1", "BO_ 2364539937 EEC1_retarder").replace("BO_ 2348810494", "BO_ 2364539937")
    path = tmp_path / "own.dbc"
    path.write_text(own)
    frames = [(i, identifier, bytes(8), 0) for i, identifier in enumerate([0x0CF00400, 0x18F00400, 0x0CF00421])]
    grids = by_name(open_file(logged("blf", frames), [path]))
    assert {name: columns["time"].size for name, columns in grids.items()} == {"EEC1": 2, "EEC1_retarder": 1}


def test_pieces_of_long_messages_and_frames_that_are_not_known_are_counted(logged, dbc):
    kinds = [(0x18EBFF00, 5), (0x18ECFF00, 2), (0x19F80523, 3), (0x123, 4), (0x18FEF121, 1), (0x0CF00400, 1)]
    frames = [(0, identifier, bytes(8), 0) for identifier, count in kinds for _ in range(count)]
    source = open_file(logged("asc", frames), [dbc])
    assert [raster.name for raster in source.rasters] == ["EEC1"]
    assert source.warnings == (
        "10 frames are left out: parts of multi-frame messages (J1939 transport protocol, NMEA 2000 fast packets).",
        "5 frames are left out, of 2 identifiers that no DBC defines; the most frequent: 0x123 (4), 0x18FEF121 (1).",
    )


def test_error_and_remote_frames_and_short_ones_are_told(logged, dbc, tmp_path):
    path = tmp_path / "errors.blf"
    with can.BLFWriter(path) as writer:
        writer(message(0, 0x0CF00400, bytes(4)))
        writer(message(0, 0x0CF00400))
        writer(can.Message(START, is_error_frame=True, channel=0))
        writer(can.Message(START, 0x0CF00400, is_remote_frame=True, channel=0))
    source = open_file(path, [dbc])
    assert source.warnings == (
        "1 error frame is left out.",
        "1 remote frame is left out.",
        "some frames are shorter than the DBC says (1 of EEC1): the signals beyond their end are missing.",
    )
    np.testing.assert_array_equal(numbers_of(source, 0)["EngineSpeed"], [np.nan, 0.0])


@pytest.mark.parametrize("suffix", WRITERS)
def test_frames_that_are_in_a_log_as_sent_and_as_received_count_once(tmp_path, dbc, suffix):
    writer = WRITERS[suffix](tmp_path / f"log.{suffix}")
    for i in range(100):
        for received in (False, True):
            sent = message(i * 0.01, 0x0CF00400)
            sent.is_rx = received
            writer(sent)
    writer.stop()
    source = open_file(tmp_path / f"log.{suffix}", [dbc])
    assert source.rasters[0].size == 100
    assert "100 frames are in the log twice, as sent and as received; each is used once." in source.warnings


@pytest.mark.slow
@pytest.mark.parametrize("suffix", WRITERS)
def test_blocks_of_any_size_and_frames_that_are_not_kept_give_the_same_numbers(logged, dbc, suffix, monkeypatch):
    path = logged(suffix, mixture())
    whole = open_file(path, [dbc])
    monkeypatch.setattr(can_file, "KEPT_FRAMES", 1000)
    again = open_file(path, [dbc])
    away = path.rename(path.with_name("away"))
    assert next(whole.tables(0, [0])).size
    with pytest.raises(FileNotFoundError):
        next(again.tables(0, [0]))
    away.rename(path)
    assert whole.rasters == again.rasters
    for index, raster in enumerate(whole.rasters):
        numbers = numbers_of(whole, index)
        for rows in (1, 7, raster.size, None):
            tables = list(again.tables(index, [0, 1], rows))
            assert [table.size for table in tables[:-1]] == [rows] * (len(tables) - 1)
            assert [table.places.number(0) for table in tables] == list(range(1, raster.size + 1, rows or raster.size))
            np.testing.assert_array_equal(np.concatenate([table.numbers[0] for table in tables]), numbers["time"])
            last = raster.headings[1].text
            np.testing.assert_array_equal(np.concatenate([table.numbers[1] for table in tables]), numbers[last])


def test_without_a_dbc_there_is_one_sentence_that_asks_for_it(logged):
    source = open_file(logged("blf", mixture()))
    assert source.rasters == ()
    assert source.problems == ("holds raw frames (500) of 8 identifiers; give the DBC with --dbc FILE.",)


def test_a_dbc_of_another_bus_is_told_with_the_commonest_identifiers(logged, dbc):
    source = open_file(logged("blf", [(i, 0x300 + i % 2, bytes(8), 0) for i in range(3)]), [dbc])
    assert source.problems == (
        "none of its 3 frames (the most frequent: 0x300 (2), 0x301 (1)) holds a signal of bus.dbc; give the DBC of "
        "this bus with --dbc FILE.",
    )


def test_a_bad_dbc_is_an_error_that_names_it(logged, tmp_path):
    path = tmp_path / "bad.dbc"
    path.write_text("nothing")
    with pytest.raises(DataError, match=r"bad\.dbc: line 1, column 1 cannot be read as DBC"):
        open_file(logged("blf", mixture(3)), [path])


def test_formats_are_told_by_content(logged, tmp_path):
    for suffix, name in (("blf", "BLF"), ("asc", "ASC"), ("mf4", "MF4")):
        path = logged(suffix, mixture(3)).rename(tmp_path / f"{suffix}.dat")
        assert frame_log(path).format == name
        assert (mf4.mdf_frames(path) is not None) == (suffix == "mf4")
    other = tmp_path / "run.csv"
    other.write_text("time [s],position [m]\n0,1\n")
    assert open_file(other).problems == ("is not a CAN log; BLF, ASC, TRC and MF4 bus logs are read.",)


@pytest.mark.parametrize(("kind", "stamps"), [("absolute", [0.0, 0.2]), ("relative", [0.0, 0.8])])
def test_an_asc_log_counts_stamps_from_its_start_and_passes_over_lines_that_cannot_be_read(save, dbc, kind, stamps):
    source = open_file(save(ASC.replace("absolute", kind), "run.asc"), [dbc])
    assert [raster.name for raster in source.rasters] == ["EEC1 (CAN1)", "EEC1 (CAN2)"]
    numbers = numbers_of(source, 0)
    np.testing.assert_array_equal(numbers["EngineSpeed"], [900.0, 904.0])
    np.testing.assert_allclose(numbers["time"], stamps, rtol=0, atol=1e-9)
    assert source.warnings == ("1 unreadable line is left out.",)
    begin = "2017-10-04T15:06:13.291000" if kind == "absolute" else "2017-10-04T15:06:13.391000"
    assert source.metadata["start"] == begin


def test_an_asc_log_without_a_date_says_that_it_has_no_absolute_time(save, dbc):
    source = open_file(save(ASC.split("\n", 1)[1], "run.asc"), [dbc])
    assert "start" not in source.metadata
    assert source.warnings[0] == "does not say when it was recorded: its time stamps start at the first frame."


@pytest.mark.parametrize("kind", ["absolute", "relative"])
def test_an_asc_log_whose_header_does_not_speak_of_internal_events_keeps_its_first_frame(save, dbc, kind):
    lines = ASC.replace("absolute", kind).splitlines(keepends=True)
    whole = numbers_of(open_file(save("".join(lines), "run.asc"), [dbc]), 0)
    without = numbers_of(open_file(save("".join([*lines[:2], *lines[5:]]), "run.asc"), [dbc]), 0)
    np.testing.assert_allclose(without["time"], whole["time"], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(without["EngineSpeed"], whole["EngineSpeed"])
    single = open_file(save("".join([*lines[:2], lines[5]]), "run.asc"), [dbc])
    assert numbers_of(single, 0)["EngineSpeed"].tolist() == [900.0]


def test_a_trc_log_counts_from_its_first_frame_and_passes_over_lines_that_cannot_be_read(save, dbc):
    source = open_file(save(TRC, "run.trc"), [dbc])
    assert (source.format, source.metadata["start"]) == ("TRC", "2023-03-15T12:00:00.100100")
    assert source.warnings[0] == "1 unreadable line is left out."
    numbers = numbers_of(source, 0)
    np.testing.assert_array_equal(numbers["EngineSpeed"], [900.0, 904.0])
    np.testing.assert_allclose(numbers["time"], [0.0, 0.2002], rtol=0, atol=1e-12)


def test_a_log_without_a_whole_frame_says_what_it_holds(save, dbc):
    lines = "   0.5 1  ErrorFrame\n   0.6 1  100  Rx  d 2 1 2\n   0.7 1  100  Rx  d 8 01\n"
    source = open_file(save(ASC.rsplit("\n", 6)[0] + "\n" + lines, "run.asc"), [dbc])
    sentence = "holds no data frames of a CAN bus, only 1 error frame, 2 unreadable lines; record it again."
    assert source.problems == (sentence,)


def test_a_trc_log_without_columns_ends_with_a_sentence(save, dbc):
    source = open_file(save(TRC.replace("=1.1", "=2.1"), "run.trc"), [dbc])
    assert source.problems == ("holds no data frames of a CAN bus; record it again.",)


def test_logs_of_other_programs_have_the_frames_that_python_can_reads(data):
    paths = sorted(path for path in data("foreign_files/can").iterdir() if path.suffix in {".asc", ".blf", ".trc"})
    assert len(paths) == 24
    for path in paths:
        with can.LogReader(path) as reader:
            theirs = [m for m in reader if not (m.is_error_frame or m.is_remote_frame)]
        ours = frames_of(path) if theirs else {"stamp": np.zeros(0)}
        assert ours["stamp"].size == len(theirs), path
        if not theirs:
            continue
        stamps = np.array([m.timestamp for m in theirs])
        np.testing.assert_allclose(ours["stamp"] - ours["stamp"][0], stamps - stamps[0], rtol=0, atol=1e-6)
        assert ours["identifier"].tolist() == [m.arbitration_id for m in theirs]
        assert ours["extended"].tolist() == [m.is_extended_id for m in theirs]
        assert [bytes(row[:n]) for row, n in zip(ours["data"], ours["length"], strict=True)] == [m.data for m in theirs]


def test_logs_whose_first_line_python_can_takes_for_a_header_are_read_completely(data):
    paths = sorted(data("foreign_files/asc_css").glob("*.asc"))
    assert len(paths) == 20
    for path in paths:
        lines = [line for line in path.read_text().splitlines()[2:] if line.strip()]
        assert frames_of(path)["stamp"].tolist() == [float(line.split()[0]) for line in lines]


def test_a_log_that_is_cut_off_is_read_up_to_there(logged, dbc):
    frames = mixture(20_000)
    path = logged("blf", frames)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    source = open_file(path, [dbc])
    assert source.warnings[0].startswith("is cut off: its header says ")
    assert 0 < sum(raster.size for raster in source.rasters) < 15_000


def test_a_damaged_block_ends_the_reading_with_a_warning(logged, dbc):
    path = logged("blf", mixture(20_000))
    content = bytearray(path.read_bytes())
    second = content.index(b"LOBJ", content.index(b"LOBJ") + 4)
    content[second : second + 4] = b"XXXX"
    path.write_bytes(content)
    (warning,) = [text for text in open_file(path, [dbc]).warnings if "damaged" in text]
    assert warning.startswith("is damaged before byte ")
    assert warning.endswith(" frames before it are used.")


@pytest.mark.parametrize("compression", [0, 1, 2])
@pytest.mark.parametrize("real", [False, True])
def test_an_mf4_log_that_asammdf_sorts_packs_and_stores_apart_has_the_same_frames(
    logged, request, tmp_path, compression, real
):
    asammdf = pytest.importorskip("asammdf", reason="asammdf packs the log")
    real_log = "css_FCBF0606_J1939_small.MF4"
    path = request.getfixturevalue("bus_logs") / real_log if real else logged("mf4", mixture())
    with asammdf.MDF(path) as mdf:
        mdf.save(tmp_path / "again.mf4", compression=compression)
    np.testing.assert_equal(frames_of(path), frames_of(tmp_path / "again.mf4"))


def test_groups_are_merged_by_their_stamps_and_a_clock_that_jumps_back_keeps_its_place():
    def blocks(*stamps, bus):
        for stamp in stamps:
            size = len(stamp)
            same = [np.full(size, number) for number in (bus, 5)]
            none = np.zeros(size, bool)
            yield Frames(np.array(stamp), *same, none, np.full(size, 8), none, as_payload([bytes(8)] * size))

    parts = [blocks([0.0, 1.0, 5.0], [6.0, 2.0, 7.0], bus=1), blocks([0.5], [5.5, 6.5], [9.0], bus=2)]
    together = list(merged(parts))
    assert np.concatenate([block.stamp for block in together]).tolist() == [0, 0.5, 1, 5, 5.5, 6, 2, 6.5, 7, 9]
    assert np.concatenate([block.bus for block in together]).tolist() == [1, 2, 1, 1, 2, 1, 1, 2, 1, 2]


@pytest.mark.parametrize(
    ("name", "frames"),
    [("css_truck_stationary_J1939", 150_411), ("css_FCBF0606_J1939_small", 1_815), ("css_94C49784_nmea", 9_600)],
)
def test_the_frames_of_real_logs_are_those_that_asammdf_reads(bus_logs, name, frames):
    asammdf = pytest.importorskip("asammdf", reason="asammdf is the oracle here")
    path, theirs = bus_logs / f"{name}.MF4", []
    ours = frames_of(path)
    with asammdf.MDF(path) as mdf:
        assert frame_log(path).start == mdf.header.start_time
        for index, group in enumerate(mdf.groups):
            if group.channel_group.cycles_nr:
                identifier = mdf.get("CAN_DataFrame.ID", index)
                data = mdf.get("CAN_DataFrame.DataBytes", index)
                theirs.append((identifier.timestamps, identifier.samples.astype(np.int64), data.samples))
    expected = [np.concatenate(columns) for columns in zip(*theirs, strict=True)]
    read_columns = [ours[name] for name in ("stamp", "identifier", "data")]
    assert read_columns[0].size == expected[0].size == frames
    order, other = np.lexsort(read_columns[1::-1]), np.lexsort(expected[1::-1])
    for values, reference in zip(read_columns, expected, strict=True):
        np.testing.assert_array_equal(values[order], reference[other])


@pytest.mark.parametrize(("name", "size"), [("css_truck_stationary_J1939", 3993), ("css_FCBF0606_J1939_small", 577)])
def test_real_logs_have_an_engine_and_a_wheel_speed(bus_logs, name, size):
    source = open_file(bus_logs / f"{name}.MF4", [bus_logs / "CSS-Electronics-SAE-J1939-DEMO.dbc"])
    assert (source.problems, source.rasters[0].size) == ((), size)
    assert [raster.name for raster in source.rasters] == ["EEC1", "CCVS1"]
    for index, signal in enumerate(["EngineSpeed", "WheelBasedVehicleSpeed"]):
        numbers = numbers_of(source, index)
        assert np.all(np.diff(numbers["time"]) > 0)
        assert np.isfinite(numbers[signal]).any()


def test_a_transport_protocol_log_says_that_its_messages_come_in_pieces(bus_logs):
    source = open_file(bus_logs / "css_94C49784_nmea.MF4", [bus_logs / "tp_nmea.dbc"])
    (problem,) = source.problems
    assert problem.startswith("none of its 9,600 frames (the most frequent: 0x09F11202 (2,399), ")
    assert "belong to multi-frame messages, which are not reassembled" in problem
