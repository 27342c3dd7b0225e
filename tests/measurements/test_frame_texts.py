"""Frames as lines of text: candump in its forms, and tables with an identifier and a payload."""

import base64
import contextlib
import re
from datetime import datetime, timedelta

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements import read
from clutchid.measurements.formats.can.file import frame_log
from clutchid.measurements.formats.kinds import is_recording, kind_of
from fixtures.sources import spoiled

STAMPS = np.round(np.arange(200) * 0.005 + 0.25, 6)
FRAMES = [
    (stamp, 0x100 + i % 2, bytes([i % 256, i // 256, 0xAA, 255, 4, 5, 6, 7])) for i, stamp in enumerate(STAMPS.tolist())
]
EPOCH = 1714564800


BUSMASTER = """***BUSMASTER Ver 3.2.2***
***PROTOCOL CAN***
***[START LOGGING SESSION]***
***START DATE AND TIME 1:5:2024 12:0:0:250***
***HEX***
***SYSTEM MODE***
***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***"""


VEHICLE_SPY = (
    "Vehicle Spy 3 Save Data File\nSave Date,5/1/2024\nNotes,\n\nNetwork Description,Hardware,Network,Protocol\n\n"
    + "".join(
        f"Line,Abs Time(Sec),Rel Time (Sec),Status,Er,Tx,Description,Network,Node,{names},Value,Trigger,Signals\n"
        for names in (
            "ID,Cycle,Ch,B1-256,Dyn,Symbol Type", "Arb ID,Remote/EDL-BRS-ESI,Xtd,B1,B2,B3,B4,B5,B6,B7,B8",
            "PT,Trgt,Src,B1,B2,B3,B4,B5,B6,B7,B8",
        )
    ).strip()
)  # fmt: skip

KVASER_CSV = """CSV CAN data
Converted from Kvaser Memorator at;2024-05-01 12:00:00
Format of data field;{}
Format of id field;{}
Time;Channel;id;Flags;DLC;Data0;Data1;Data2;Data3;Data4;Data5;Data6;Data7;Counter"""

MEMORATOR = """                              Kvaser Memorator Log
                              ====================

Memorator Binary logfile created at: 2024-05-01 12:00:00

Settings:
   Format of data field: HEX
   Format of id field:   HEX
   Timestamp Offset:     0.000000           s

        Time Chan   Identifier Flags        DLC  Data                            Counter
===================================================================================="""


def clock(seconds):
    """As BUSMASTER writes it: hours, minutes, seconds and tenths of a millisecond."""
    minutes, rest = divmod(round(seconds * 1e4), 600_000)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 10_000:02d}:{rest % 10_000:04d}"


def spaced(data):
    return data.hex(" ").upper()


def hexed(data, between):
    return between.join(f"{byte:02X}" for byte in data)


def lines(form):
    """The frames as lines of text."""
    gaps = np.diff(STAMPS, prepend=STAMPS[0])
    rows = [(*frame, gap) for frame, gap in zip(FRAMES, gaps.tolist(), strict=True)]
    head, line = {
        "-L": ("", lambda t, i, d, _: f"({EPOCH + t:.6f}) can0 {i:03X}#{d.hex().upper()}"),
        "-L fd": ("", lambda t, i, d, _: f"({EPOCH + t:.6f}) can0 {i:03X}##1{d.hex()}"),
        "-L way": ("", lambda t, i, d, _: f"({EPOCH + t:.6f}) can0 {i:03X}#{d.hex()} R"),
        "-ta": ("", lambda t, i, d, _: f" ({EPOCH + t:.6f})  can0  {i:03X}   [8]  {spaced(d)}   '........'"),
        "-tA": ("", lambda t, i, d, _: f" (2024-05-01 12:00:{t:09.6f})  can0  {i:03X}   [8]  {spaced(d)}"),
        "-tz": ("", lambda t, i, d, _: f" ({t:010.6f})  can0  {i:03X}   [8]  {spaced(d)}"),
        "-td": ("", lambda _, i, d, g: f" ({g:010.6f})  can0  {i:03X}   [8]  {spaced(d)}"),
        "gvret": (
            "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8",
            lambda t, i, d, _: f"{round(t * 1e6)},{i:08X},false,Rx,0,8,{','.join(f'{b:02X}' for b in d)},",
        ),
        "css": (
            "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes",
            lambda t, i, d, _: f"{EPOCH + t:.6f};1;{i:x};0;8;8;0;0;0;{d.hex().upper()}",
        ),
        "python-can": (
            "timestamp,arbitration_id,extended,remote,error,dlc,data",
            lambda t, i, d, _: f"{EPOCH + t:.6f},0x{i:x},0,0,0,8,{base64.b64encode(d).decode()}",
        ),
        "decimal": (
            "Time,Channel,ID,Flags,DLC,Data0,Data1,Data2,Data3,Data4,Data5,Data6,Data7",
            lambda t, i, d, _: f"{t:.6f},1,{i},,8,{','.join(map(str, d))}",
        ),
        "vehicle spy": (
            VEHICLE_SPY,
            lambda t, i, d, _: (
                f"1,{550000000 + t:.6f},{t},67371012,F,F,HS CAN ${i:X},HS CAN,,{i:X},F,F,{hexed(d, ',')},,,"
            ),
        ),
        "kvaser csv": (
            KVASER_CSV.format("HEX", "DEC"),
            lambda t, i, d, _: f"{t:.6f};1;{i};2;8;{hexed(d, ';').lower()};7".replace(".", ","),
        ),
        "canking": (
            "Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir",
            lambda t, i, d, _: f" 0    {i:08X}         8  {hexed(d, '  ')}  {t:14.6f} R",
        ),
        "canking decimal": (
            "Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir",
            lambda t, i, d, _: f" 0    {i:8d}         8  {'  '.join(f'{b:3d}' for b in d)}  {t:14.6f} R",
        ),
        "memorator": (
            MEMORATOR,
            lambda t, i, d, _: f"{t:12.6f}  1  {i:10X}    Rx            8  {spaced(d)}                  12",
        ),
        "ixxat": (
            "ASCII Trace IXXAT Automation GmbH\nDate: 01.05.2024\nTime;Identifier (hex);Format;Flags;Data (hex)",
            lambda t, i, d, _: f"00:00:{t:09.6f};{i:X};Std;;{spaced(d)}",
        ),
        "css text": (
            "# Logger type: CL2000\n# Time: 20240501T120000\nTimestamp;Type;ID;Data",
            lambda t, i, d, _: f"01T1200{round(t * 1e3):05d};0;{i:x};{d.hex()}",
        ),
        "cabana": ("time,addr,bus,data", lambda t, i, d, _: f"{t:.6f},0x{i:x},0,0x{d.hex()}"),
        "trace window": ("", lambda t, i, d, _: f"{t:.6f} 1  {i:X}             Rx   d 8 {spaced(d)}"),
        "busmaster": (BUSMASTER, lambda t, i, d, _: f"{clock(43200 + t)} Rx 1 0x{i:03X} s 8 {spaced(d)} "),
        "busmaster decimal": (
            BUSMASTER.replace("HEX", "DEC").replace("SYSTEM", "RELATIVE"),
            lambda _, i, d, g: f"{clock(g)} Rx 1 {i:03d} s 8 {' '.join(f'{b:03d}' for b in d)}",
        ),
        "asc": (
            "date Wed May 1 12:00:00.000 pm 2024\nbase hex  timestamps absolute",
            lambda t, i, d, _: f"{t:11.6f} 1  {i:X}  Rx   d 8 {spaced(d)}",
        ),
        "trc": (
            ";$FILEVERSION=1.1\n;$STARTTIME=45413.5",
            lambda t, i, d, _: f"{round(t * 1e3):6d}) {t * 1e3:12.1f}  Rx     {i:04X}  8  {spaced(d)}",
        ),
    }[form]
    return [head, *(line(*row) for row in rows)][not head :]


FORMS = [
    "-L", "-L fd", "-L way", "-ta", "-tA", "-tz", "-td", "gvret", "css", "python-can", "decimal", "busmaster",
    "busmaster decimal", "vehicle spy", "kvaser csv", "canking", "canking decimal", "memorator", "ixxat", "css text",
    "cabana", "trace window",
]  # fmt: skip


#: Forms whose lines do not say how long the payload is.
WITHOUT_LENGTH = ("-L", "ixxat", "css text", "cabana", "vehicle spy")


@pytest.mark.parametrize("form", FORMS)
def test_frames_are_the_same_in_every_text(form, save):
    path = save("\n".join(lines(form)) + "\n", "run.log")
    assert is_recording(path), "also one that is found in a folder"
    (block,) = frame_log(path).blocks()
    assert block.identifier.tolist() == [identifier for _, identifier, _ in FRAMES]
    assert [bytes(row) for row in block.data] == [data for _, _, data in FRAMES]
    assert np.allclose(block.stamp - block.stamp[0], STAMPS - STAMPS[0], rtol=0, atol=1e-9)
    assert not block.extended.any()


@pytest.mark.parametrize("form", [*FORMS, "asc", "trc"])
def test_a_line_that_is_cut_off_is_no_frame_with_zeros(form, save):
    *text, last = lines(form)[-9:]
    head, data = lines(form)[: -len(FRAMES)], FRAMES[-1][2]
    for cut in range(len(last) - 20, len(last)):
        (block,) = frame_log(save("\n".join([*head, *text, last[:cut]]), "run.log")).blocks()
        if len(block) > 8:
            assert form.startswith(WITHOUT_LENGTH) or block.length[-1] == 8
            size = min(int(block.length[-1]), 7)  # of the last byte a digit may be missing
            assert bytes(block.data[-1])[:size] == data[:size]


@pytest.mark.parametrize("name", ["Type", "Format"])
@pytest.mark.parametrize(
    ("kind", "extended"), [("1", 0), ("9", 0), ("T", 0), ("Std", 0), ("x", 1), ("Ext", 1), ("29", 1)]
)
def test_a_type_says_29_bits_by_a_word_only(name, kind, extended, save):
    rows = [f"{t:.6f},{kind},{i:X},8,{d.hex()}" for t, i, d in FRAMES]
    (block,) = frame_log(save("\n".join([f"Time,{name},ID,DLC,Data", *rows]) + "\n", "run.csv")).blocks()
    assert block.extended.tolist() == [extended] * len(FRAMES)


def test_a_short_frame_ends_its_line_early(save):
    rows = [f"{t:.6f},{i:X},1,{hexed(d[: 4 if i % 2 else 8], ',')}" for t, i, d in FRAMES]
    (block,) = frame_log(save("\n".join(["Time,ID,Bus,B0,B1,B2,B3,B4,B5,B6,B7", *rows]) + "\n", "run.csv")).blocks()
    assert block.length.tolist() == [4 if i % 2 else 8 for _, i, _ in FRAMES]


@pytest.mark.parametrize("form", ["-td", "busmaster decimal"])
def test_a_remote_frame_counts_in_times_since_the_line_before(form, save):
    text, at = lines(form), len(lines(form)) - 100
    remote = {"-td": r"[0]  remote request", "busmaster decimal": "sr 8"}[form]
    text[at] = re.sub(r"\[8\].*|s 8 .*", remote, text[at])
    (block,) = frame_log(save("\n".join(text) + "\n", "run.log")).blocks()
    assert dict(block.left_out) == {"remote frame": 1}
    assert block.stamp[-1] - block.stamp[0] == pytest.approx(STAMPS[-1] - STAMPS[0], abs=1e-9)


def test_candump_without_stamps_is_refused_with_what_to_do(save):
    path = save("\n".join(f"  can0  {i:03X}   [8]  {spaced(d)}" for _, i, d in FRAMES) + "\n", "run.log")
    with pytest.raises(DataError, match="without time stamps; record it with `candump -L`"):
        read(path)


def test_spoiled_lines_remote_frames_and_sent_ones_are_told_apart(save):
    text = lines("-L")
    text[3:5] = ["(oops", "(1714564800.265000) can0 100#R8"]
    text[5] += " T"
    (block,) = frame_log(save("\n".join(text) + "\n", "run.log")).blocks()
    assert dict(block.left_out) == {"unreadable line": 1, "remote frame": 1}
    assert np.flatnonzero(block.sent).tolist() == [3]


@pytest.mark.parametrize(
    "head",
    [
        b"time [s],ID,Data,position [m]\n0,1,2,3\n", b"time;id;data;position [mm];type\n0;7;1;0;0\n",
        b"time [s];position [mm];d1 [%];d2 [%];id;type\n0;1;0;9;7;1\n",
        b"LOGGER;time\n1;2\n", b"PAR1;PAR2\n1;2\n", b"BZh;x\n1;2\n",
        b"Date;Time;Position\n2024-05-01;1;2\n", b"base hex;x\n1;2\n", b"can0,can1\n1,2\n",
    ],
)  # fmt: skip
def test_one_sign_makes_no_other_kind_of_a_table(head):
    assert kind_of(head) == "csv"


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_spoiled_texts_give_frames_or_a_sentence(form, tmp_path):
    good, path = ("\n".join(lines(form)) + "\n").encode(), tmp_path / "run.log"
    for seed in range(50):
        path.write_bytes(spoiled(good, seed))
        with contextlib.suppress(DataError):
            assert sum(map(len, frame_log(path).blocks())) <= len(FRAMES) + 40


def test_a_number_of_a_bus_may_be_any(save):
    text = lines("gvret")
    text[3] = text[3].replace(",Rx,0,", f",Rx,{'9' * 30},")
    (block,) = frame_log(save("\n".join(text) + "\n", "run.csv")).blocks()
    assert block.bus.tolist()[:4] == [1, 1, 0xFFFF, 1]


def test_a_log_of_busmaster_says_when_it_began_and_passes_over_what_is_no_frame(save):
    text = lines("busmaster")
    text[10:12] = ["oops", "12:00:00:2650 Rx 1 0x100 sr 8 "]
    text += ["***[STOP LOGGING SESSION]***"]
    log = frame_log(save("\n".join(text) + "\n", "run.log"))
    (block,) = log.blocks()
    assert dict(block.left_out) == {"unreadable line": 1, "remote frame": 1}
    assert log.start + timedelta(seconds=block.stamp[0]) == datetime(2024, 5, 1, 12, 0, 0, 250_000)
    absolute = [line.replace("SYSTEM", "ABSOLUTE") for line in lines("busmaster")]
    assert frame_log(save("\n".join(absolute) + "\n", "absolute.log")).start == datetime(2024, 5, 1, 12)
    other = [line.replace("PROTOCOL CAN", "PROTOCOL J1939") for line in text]
    with pytest.raises(DataError, match="is a log of J1939; record the frames of the CAN bus"):
        read(save("\n".join(other) + "\n", "other.log"))
