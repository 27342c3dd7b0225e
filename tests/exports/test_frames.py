"""The DBC of results: what a control unit sends can be read, and no two signals touch each other."""

import pytest

from clutchid.exports.frames import LENGTH, MESSAGES, results_dbc
from clutchid.measurements.formats.can.dbc import messages_in
from clutchid.observer.health import FLAGS


def test_the_dbc_has_all_messages_and_signals():
    read = messages_in(results_dbc())
    assert [(reading.name, reading.identifier, reading.length) for reading in read] == [
        (reading.name, reading.identifier, LENGTH) for reading in MESSAGES
    ]
    for reading, sent in zip(read, MESSAGES, strict=True):
        assert {(s.name, s.begin, s.length, s.scale, s.offset, s.unit) for s in reading.groups[0].signals} == {
            (s.name, s.begin, s.length, s.scale, s.offset, s.unit) for s in sent.signals
        }
    assert {*FLAGS, "trust"} == {signal.name for signal in MESSAGES[-1].signals}


def test_no_two_signals_share_a_bit():
    for message in MESSAGES:
        bits = [bit for signal in message.signals for bit in range(signal.begin, signal.begin + signal.length)]
        assert len(bits) == len(set(bits))
        assert max(bits) < 8 * LENGTH


def test_a_message_comes_every_10_ms_and_the_highest_number_of_a_signal_is_unknown():
    cantools = pytest.importorskip("cantools")
    database = cantools.database.load_string(results_dbc(), "dbc")
    assert [message.cycle_time for message in database.messages] == [10] * len(MESSAGES)
    for signal in [signal for message in database.messages[:2] for signal in message.signals]:
        assert {level: str(word) for level, word in signal.choices.items()} == {0xFFFF: "unknown"}
        assert signal.maximum == pytest.approx(signal.scale * 0xFFFE + signal.offset)
    trust = database.get_message_by_name("ClutchHealth").get_signal_by_name("trust")
    assert {level: str(word) for level, word in trust.choices.items()} == {0: "none", 1: "with care", 2: "good"}
