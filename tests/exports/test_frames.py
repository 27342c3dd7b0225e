"""Results as frames: every value comes back through the DBC, and what is not known says so."""

import numpy as np
import pytest

from clutchid.exports.frames import LENGTH, MESSAGES, packed, results_dbc
from clutchid.measurements.formats.can.dbc import decode, messages_in
from clutchid.observer.health import FLAGS, LIVE_FLAGS


def test_the_dbc_has_the_signals_that_are_sent():
    read = messages_in(results_dbc())
    assert [(reading.name, reading.identifier, reading.length) for reading in read] == [
        (reading.name, reading.identifier, LENGTH) for reading in MESSAGES
    ]
    for reading, sent in zip(read, MESSAGES, strict=True):
        assert {(s.name, s.begin, s.length, s.scale, s.offset, s.unit) for s in reading.groups[0].signals} == {
            (s.name, s.begin, s.length, s.scale, s.offset, s.unit) for s in sent.signals
        }
    assert {*FLAGS, *LIVE_FLAGS} <= {signal.name for signal in MESSAGES[-1].signals}


@pytest.mark.parametrize("message", MESSAGES, ids=lambda sent: sent.name)
def test_values_come_back_to_half_a_step_and_do_not_touch_each_other(message):
    random = np.random.default_rng(1)
    most = [s.offset + s.scale * ((1 << s.length) - (2 if s.length > 1 else 1)) for s in message.signals]
    values = [random.uniform(s.offset, high, 500) for s, high in zip(message.signals, most, strict=True)]
    data = np.frombuffer(b"".join(packed(message.signals, values)), dtype=np.uint8).reshape(-1, LENGTH)
    for signal, value in zip(message.signals, values, strict=True):
        back = decode(signal, data, np.full(len(data), LENGTH))
        assert back == pytest.approx(value, abs=signal.scale * (0.5 + 1e-6))


def test_what_is_unknown_is_the_highest_number_and_what_is_too_large_the_one_below():
    signals = MESSAGES[0].signals
    values = [np.array([np.nan, 1e9, -1e9])] * len(signals)
    data = np.frombuffer(b"".join(packed(signals, values)), dtype="<u2").reshape(3, 4)
    assert data.tolist() == [[0xFFFF] * 4, [0xFFFE] * 4, [0] * 4]
    assert '"unknown"' in results_dbc()


def test_no_two_signals_share_a_bit():
    for message in MESSAGES:
        bits = [bit for signal in message.signals for bit in range(signal.begin, signal.begin + signal.length)]
        assert len(bits) == len(set(bits))
        assert max(bits) < 8 * LENGTH


def test_a_message_has_its_cycle_time_and_c_the_signals_that_it_sets():
    cantools = pytest.importorskip("cantools")
    for every, of_c in ((0.01, True), (0.05, False), (0.0, False)):
        database = cantools.database.load_string(results_dbc(every, of_c=of_c), "dbc")
        assert [message.cycle_time or 0 for message in database.messages] == [round(1e3 * every)] * len(MESSAGES)
        signals = {signal.name for message in database.messages for signal in message.signals}
        assert set(FLAGS) <= signals
        assert not of_c or not {"sample_time", "used", *LIVE_FLAGS} & signals
        assert of_c or {"sample_time", "used", *LIVE_FLAGS} <= signals
