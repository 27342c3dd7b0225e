"""Frames as lines of text: candump in its forms; what other tools write is refused with what to do."""

import contextlib
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements import read
from clutchid.measurements.formats.can.file import frame_log
from clutchid.measurements.formats.kinds import is_recording, kind_of
from fixtures.sources import spoiled

#: The same frames as each program writes them, a file a program.
TEXTS = {path.stem: path.read_text() for path in sorted(Path(__file__).with_name("texts").glob("frames/*.log"))}

STAMPS = np.round(np.arange(24) * 0.005 + 0.25, 6)
FRAMES = [(stamp, 0x100 + i % 2, bytes([i, 0, 0xAA, 255, 4, 5, 6, 7])) for i, stamp in enumerate(STAMPS.tolist())]

#: Forms that are read, of candump and of a trace window.
READ = {form: text for form, text in TEXTS.items() if form.startswith(("candump", "asc", "trc", "trace"))}
FORMS = sorted(READ.keys() - {"asc", "trc"})


#: Forms of lines: what is above them, and pairs of a line and its answer.
CASES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())["form"]


@pytest.mark.parametrize(
    ("kind", "head", "line", "answer"),
    [(form["kind"], form["head"], *pair) for form in CASES for pair in form["lines"]],
)
def test_a_line_is_a_frame_or_what_it_is_instead(kind, head, line, answer, save):
    said = []
    for block in frame_log(save(f"{head}{line}\n", "run.log"), kind).blocks():
        said += block.left_out
        fields = (block.stamp, block.bus, block.identifier, block.extended, block.sent, block.length)
        for row, (*cells, long, sent, size) in enumerate(zip(*(field.tolist() for field in fields), strict=True)):
            payload = block.data[row, :size].tobytes().hex().upper()
            said.append("{:g} {} {:X}{} {} {}".format(*cells, "x" * long, "Tx" if sent else "Rx", payload))
    assert said == ([answer] if answer else [])


def lines(form):
    return TEXTS[form].splitlines()


@pytest.mark.parametrize("form", FORMS)
def test_frames_are_the_same_in_every_text(form, save):
    path = save(TEXTS[form], "run.log")
    assert is_recording(path), "also one that is found in a folder"
    (block,) = frame_log(path).blocks()
    assert block.identifier.tolist() == [identifier for _, identifier, _ in FRAMES]
    assert [bytes(row) for row in block.data] == [data for _, _, data in FRAMES]
    assert np.allclose(block.stamp - block.stamp[0], STAMPS - STAMPS[0], rtol=0, atol=1e-9)
    assert not block.extended.any()


@pytest.mark.parametrize("form", READ)
def test_a_line_that_is_cut_off_is_no_frame_with_zeros(form, save):
    *text, last = lines(form)[-9:]
    head, data = lines(form)[: -len(FRAMES)], FRAMES[-1][2]
    for cut in range(len(last) - 20, len(last)):
        (block,) = frame_log(save("\n".join([*head, *text, last[:cut]]), "run.log")).blocks()
        if len(block) > 8:
            size = int(block.length[-1])
            assert form.startswith("candump_L") or size == 8
            assert bytes(block.data[-1])[:size] == data[:size]


@pytest.mark.parametrize("form", sorted(TEXTS.keys() - READ.keys()))
def test_what_other_tools_write_is_refused_with_what_to_do(form, save):
    path = save(TEXTS[form], "run.log")
    assert is_recording(path), "so that a folder with it says it, too"
    what = {"b": "log of BUSMASTER", "m": "log of Kvaser"}.get(
        form[0], "log of Kvaser" if "king" in form else "table of frames"
    )
    with pytest.raises(DataError, match=f"run.log: is a {what}; convert it to BLF or ASC with the tool that wrote it"):
        read(path)


def test_a_remote_frame_counts_in_times_since_the_line_before(save):
    text = lines("candump_td")
    text[-9] = re.sub(r"\[8\].*", r"[0]  remote request", text[-9])
    (block,) = frame_log(save("\n".join(text) + "\n", "run.log")).blocks()
    assert dict(block.left_out) == {"remote frame": 1}
    assert block.stamp[-1] - block.stamp[0] == pytest.approx(STAMPS[-1] - STAMPS[0], abs=1e-9)


def test_candump_without_stamps_is_refused_with_what_to_do(save):
    path = save("".join(f"  can0  {i:03X}   [8]  {d.hex(' ')}\n" for _, i, d in FRAMES), "run.log")
    with pytest.raises(DataError, match="without time stamps; record it with `candump -L`"):
        read(path)


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
    good, path = TEXTS[form].encode(), tmp_path / "run.log"
    for seed in range(50):
        path.write_bytes(spoiled(good, seed))
        with contextlib.suppress(DataError):
            assert sum(map(len, frame_log(path).blocks())) <= len(FRAMES) + 40
