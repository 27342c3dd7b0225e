"""DBC: what NumPy unpacks in bulk is what cantools decodes message by message."""

import contextlib
import math
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from clutchid.errors import DataError
from clutchid.measurements.formats.can.dbc import Signal, SignalGroup, decode, messages_in, present, raw_bits, read_dbc
from clutchid.measurements.formats.can.j1939 import first_code

cantools = pytest.importorskip("cantools", reason="cantools, of the extra can, reads the DBC and is the oracle")

HEAD = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: ECU\n\n'
J1939 = (
    'BA_DEF_ BO_  "VFrameFormat" ENUM  "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
    'BA_DEF_DEF_  "VFrameFormat" "J1939PG";\n'
)
MUXED, CODES = (Path(__file__).with_name("texts").joinpath(name).read_text() for name in ("muxed.dbc", "codes.dbc"))


def dbc_of(signals: list[str], name: str = "Any") -> str:
    """A DBC with one message of 8 bytes."""
    return HEAD + f"BO_ 100 {name}: 8 ECU\n" + "".join(f" SG_ {signal}\n" for signal in signals)


numbers = st.one_of(st.integers(-1000, 1000).filter(bool), st.sampled_from([0.125, 0.1, 1e-05, -0.3, 1e9]))


@st.composite
def signals(draw):
    """The text of a signal anywhere in 8 bytes, in either order, and whether it is a number of IEEE 754."""
    ieee = draw(st.booleans())
    length = draw(st.sampled_from([32, 64]) if ieee else st.integers(1, 64))
    begin = draw(st.integers(0, 64 - length))
    motorola = draw(st.booleans())
    start = 8 * (begin // 8) + 7 - begin % 8 if motorola else begin
    sign = draw(st.sampled_from("+-"))
    scale, offset = draw(numbers), draw(st.one_of(st.just(0), numbers))
    text = f'X : {start}|{length}@{0 if motorola else 1}{sign} ({scale},{offset}) [0|0] "bar" ECU'
    return text + (f"\nSIG_VALTYPE_ 100 X : {1 if length == 32 else 2};" if ieee else "")


@example('X : 0|12@1+ (1,0) [0|0] "bar" ECU', [b"\xff" * 8])
@example('X : 2|57@1+ (257,0.125) [0|0] "bar" ECU', [bytes([4, 28, 0, 0, 0, 0, 0, 4])])
@given(signals(), st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=20))
def test_numbers_unpacked_in_bulk_equal_those_of_cantools(text, payloads):
    dbc = dbc_of([text])
    theirs = cantools.database.load_string(dbc, "dbc").messages[0]
    (signal,) = messages_in(dbc)[0].groups[0].signals
    ours = decode(signal, np.frombuffer(b"".join(payloads), dtype=np.uint8).reshape(-1, 8), np.full(len(payloads), 8))
    for value, payload in zip(ours.tolist(), payloads, strict=True):
        expected = theirs.decode(payload, decode_choices=False)["X"]
        raw = theirs.decode(payload, scaling=False)["X"]
        if means_none(theirs.signals[0], raw) or math.isnan(expected):
            assert math.isnan(value)
        elif value != expected:
            # cantools keeps whole numbers exact; here raw, product and sum are rounded to 53 bits, one time each
            assert isinstance(raw, int)
            assert max(abs(raw), abs(raw * signal.scale), abs(expected)) > 2**53
            assert abs(value - expected) <= 3 * 2**-53 * (abs(raw * signal.scale) + abs(signal.offset) + abs(expected))


def means_none(signal, raw):
    """Whether a raw number is all ones of 8 to 32 bits without sign and range, which mean that there is no value."""
    whole = not (signal.is_signed or signal.is_float)
    return whole and 8 <= signal.length <= 32 and raw == (1 << signal.length) - 1


@example(payload=bytes([0, 0xFF, 0xFF, 0, 0, 0, 0, 0xFF]))
@given(payload=st.binary(min_size=8, max_size=8))
def test_signals_under_several_selectors_are_those_of_cantools(payload):
    theirs = cantools.database.load_string(MUXED, "dbc").messages[0]
    raw = theirs.decode(payload, scaling=False)
    expected = {
        name: math.nan if means_none(theirs.get_signal_by_name(name), raw[name]) else value
        for name, value in theirs.decode(payload, decode_choices=False).items()
    }
    data, length = np.frombuffer(payload, dtype=np.uint8).reshape(1, 8), np.array([8])
    pages = [page for page in messages_in(MUXED)[0].groups if present(page, data, length)[0]]
    decoded = {s.name: decode(s, data, length)[0] for page in pages for s in page.signals}
    assert decoded == pytest.approx(expected, rel=0.0, abs=0.0, nan_ok=True)


def test_the_pages_of_a_multiplexed_message_are_named_by_what_selects_them():
    pages = messages_in(MUXED)[0].groups
    assert {page.name: {signal.name for signal in page.signals} for page in pages} == {
        "": {"Outer", "Always"},
        "Outer=0": {"Zero"},
        "Outer=1,5-6": {"Inner"},
        "Outer=2,4,7": {"Rest"},
        "Outer=3,8-15": {"Wide"},
        "Outer=1,5-6 Inner=2-4,9": {"Deep"},
        "Outer=1,5-6 Inner=0-1,5-8,10-15": {"Other"},
    }


def test_a_frame_that_is_too_short_has_no_value():
    signal = Signal("Pressure", 24, 16)
    data = np.full((3, 8), 1, dtype=np.uint8)
    np.testing.assert_array_equal(decode(signal, data, np.array([8, 5, 4])), [257.0, 257.0, np.nan])
    assert np.isnan(decode(Signal("Far", 400, 8), data, np.array([8, 8, 8]))).all()


def test_a_frame_too_short_for_its_selector_shows_no_page_though_the_bytes_that_it_lacks_are_zero():
    mode, pressure = Signal("Mode", 16, 8), Signal("Pressure", 0, 8)
    page = SignalGroup((pressure,), ((mode, frozenset({0})),))
    data = np.array([[7, 0, 0, 0, 0, 0, 0, 0], [7, 0, 0, 0, 0, 0, 0, 0], [7, 0, 1, 0, 0, 0, 0, 0]], dtype=np.uint8)
    assert present(page, data, np.array([3, 2, 3])).tolist() == [True, False, False]
    far = SignalGroup((pressure,), ((Signal("Far", 64, 8), frozenset({0})),))
    assert not present(far, data, np.array([8, 8, 8])).any()


def test_a_signal_over_nine_bytes_keeps_all_its_bits():
    value = 0xF123456789ABCDEF
    intel = np.frombuffer((value << 3).to_bytes(9, "little") + bytes(7), dtype=np.uint8).reshape(1, 16)
    motorola = np.frombuffer((value << 5).to_bytes(9, "big") + bytes(7), dtype=np.uint8).reshape(1, 16)
    assert int(raw_bits(Signal("x", 3, 64), intel)[0]) == value
    assert int(raw_bits(Signal("x", 3, 64, motorola=True), motorola)[0]) == value


@pytest.mark.parametrize(
    ("bits", "code"),
    [(1, None), (2, 0b10), (3, 0b110), (4, 0xE), (8, 0xFE), (10, 0x3F8), (16, 0xFE00), (32, 0xFE000000), (33, None)],
)
def test_errors_and_not_available_begin_where_the_standard_says(bits, code):
    assert first_code(bits) == code


def test_in_a_j1939_message_codes_are_missing_values_but_not_of_signed_ones_and_selectors():
    text = HEAD + (
        'BO_ 2364540158 EEC1: 8 ECU\n SG_ Speed : 24|16@1+ (0.125,0) [0|0] "rpm" ECU\n'
        ' SG_ Signed : 24|16@1- (1,0) [0|0] "" ECU\n SG_ Mode M : 0|8@1+ (1,0) [0|0] "" ECU\n'
        ' SG_ Page m255 : 8|2@1+ (1,0) [0|0] "" ECU\n'
    )
    with_codes, without = messages_in(text + J1939)[0], messages_in(text)[0]
    assert (with_codes.j1939, without.j1939) == (True, False)
    data = np.array([[255, 1, 0, 0xFF, 0xFD, 0, 0, 0], [255, 2, 0, 0x00, 0xFE, 0, 0, 0]], dtype=np.uint8)
    for message, speeds in ((with_codes, [0xFDFF / 8, np.nan]), (without, [0xFDFF / 8, 0xFE00 / 8])):
        values = {s.name: decode(s, data, np.array([8, 8])) for page in message.groups for s in page.signals}
        np.testing.assert_array_equal(values["Speed"], speeds)
        np.testing.assert_array_equal(values["Signed"], [0xFDFF - 65536, 0xFE00 - 65536])
        np.testing.assert_array_equal(values["Mode"], [255, 255])
        np.testing.assert_array_equal(values["Page"], [1, np.nan if message.j1939 else 2])


def test_the_protocol_of_the_whole_file_counts_where_a_message_names_none():
    message = 'BO_ 2364540158 EEC1: 8 ECU\n SG_ S : 24|16@1+ (1,0) [0|0] "" ECU\n\nBO_ 5 Own: 8 ECU\n\n'
    protocol = 'BA_DEF_  "ProtocolType" STRING ;\nBA_DEF_DEF_  "ProtocolType" "";\n'
    messages = messages_in(HEAD + message + protocol + 'BA_ "ProtocolType" "J1939";\n')
    assert [(entry.name, entry.j1939) for entry in messages] == [("EEC1", True), ("Own", False)]
    assert not any(entry.j1939 for entry in messages_in(HEAD + message + protocol))


def test_units_comments_and_value_tables_are_kept_as_a_number_with_its_heading():
    text = dbc_of(['Gear : 0|8@1- (1,0) [0|0] "1" ECU']) + '\nCM_ SG_ 100 Gear "Engaged";\nVAL_ 100 Gear 3 "third" ;\n'
    (signal,) = messages_in(text)[0].groups[0].signals
    assert (signal.unit, signal.comment) == ("1", "Engaged")
    assert decode(signal, np.full((1, 8), 3, dtype=np.uint8), np.array([8])).tolist() == [3.0]


def test_umlauts_are_read_from_either_encoding(tmp_path):
    for encoding in ("utf-8", "cp1252"):
        path = tmp_path / f"{encoding}.dbc"
        path.write_bytes(dbc_of(['T : 0|8@1+ (1,0) [0|0] "°C" ECU']).encode(encoding))
        assert read_dbc(path)[0].groups[0].signals[0].unit == "°C"


@pytest.mark.parametrize(
    ("text", "where"),
    [
        (dbc_of(["X : 0|8@1+ (1,0"]), "cut off after line 10"),
        (dbc_of(["X : 0|8@1+ (1,0) [0|0] ECU"]) + "\nBO_ 101 Next: 8 ECU\n", "line 10, column 29"),
        (HEAD, "holds no messages"),
        ("", "holds no messages"),
        ("time [s],position [m]\n0,1\n", "line 1, column 1"),
        (MUXED.replace("8-15", "8-4294967295"), "line 22: more than 65,536"),
        ('<?xml version="1.0"?><NetworkDefinition/>', "is ARXML, KCD or SYM; convert it to DBC: cantools convert FILE"),
        ("// x\n\nFormatVersion=6.0 // x\n", "is ARXML, KCD or SYM; convert it to DBC"),
    ],
)
def test_what_is_no_dbc_is_refused_in_one_sentence_that_names_file_and_line(tmp_path, text, where):
    path = tmp_path / "bus.dbc"
    path.write_text(text)
    with pytest.raises(DataError, match=where) as caught:
        read_dbc(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_signals_that_are_no_number_are_named_apart():
    text = (
        HEAD + 'BO_ 100 Text: 64 ECU\n SG_ Name : 0|200@1+ (1,0) [0|0] "" ECU\n SG_ X : 200|8@1+ (1,0) [0|0] "" ECU\n'
    )
    (message,) = messages_in(text)
    assert message.undecodable == ("Name",)
    assert [signal.name for signal in message.groups[0].signals] == ["X"]


def values_of(page, payload):
    """The values of a page in a payload, by their names; nothing where the page is not present."""
    data = np.frombuffer(payload.ljust(64, b"\0"), dtype=np.uint8)[None]
    length = np.array([len(payload)])
    if not present(page, data, length)[0]:
        return {}
    return {signal.name: float(decode(signal, data, length)[0]) for signal in page.signals}


@pytest.mark.slow
def test_databases_decode_as_cantools_does(data):
    count = 0
    dice = random.Random(1)
    for path in sorted(data("foreign_files/dbc").glob("*.dbc")):
        with contextlib.suppress(DataError):
            messages = read_dbc(path)
            theirs = cantools.database.load_file(path, strict=False).messages
            for ours, message in zip(messages, theirs, strict=True):
                payload = bytes(dice.choice((0, 1, 2, dice.randrange(256))) for _ in range(message.length))
                with contextlib.suppress(cantools.database.DecodeError):
                    expected = message.decode(payload, decode_choices=False)
                    values = {name: value for page in ours.groups for name, value in values_of(page, payload).items()}
                    signals = [signal for page in ours.groups for signal in page.signals]
                    coded = {signal.name: bool(signal.none) for signal in signals}
                    for name, value in values.items():
                        missing = math.isnan(value) and (ours.j1939 or coded[name])
                        same = value == pytest.approx(expected[name], rel=1e-9, nan_ok=True)
                        assert missing or same, (path, name)
                        count += 1
    assert count > 500


@pytest.mark.parametrize(
    ("signal", "raw", "none"),
    [
        ("Said", 0x1234, True), ("Said", 0x1235, True), ("Said", 0, False), ("Said", 0xFFFF, True),
        ("Ranged", 0xFFFF, True), ("Ranged", 0xFE00, True), ("Ranged", 0xFA00, False), ("Full", 0xFF, False),
        ("Signed", 0x7FFF, True), ("Signed", 0x8000, True), ("Signed", 0xFFFF, False), ("State", 3, False),
    ],
)  # fmt: skip
def test_codes_that_mean_none_are_missing_in_any_database(signal, raw, none):
    (message,) = messages_in(CODES)
    (group,) = message.groups
    coded = next(candidate for candidate in group.signals if candidate.name == signal)
    data = np.frombuffer((raw << coded.begin).to_bytes(8, "little"), dtype=np.uint8).reshape(1, 8)
    assert np.isnan(decode(coded, data, np.array([8])))[0] == none
