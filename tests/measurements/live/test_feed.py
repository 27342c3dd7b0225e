"""Bytes while they arrive: whole, and in order."""

import os
import threading
import time

from clutchid.measurements.live.feed import from_descriptor


def test_a_pipe_is_read_until_it_is_closed_and_its_last_line_is_ended():
    reading, writing = os.pipe()

    def send():
        for piece in (b"one\n", b"two"):
            os.write(writing, piece)
            time.sleep(0.05)
        os.close(writing)

    sender = threading.Thread(target=send)
    sender.start()
    assert b"".join(from_descriptor(reading, lambda: False)) == b"one\ntwo\n"
    sender.join()
    os.close(reading)
