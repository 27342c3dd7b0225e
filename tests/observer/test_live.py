"""A recording that has not ended: the numbers of the whole one, in constant memory."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.observer import live as module
from clutchid.observer import start
from clutchid.observer.health import LIVE_FLAGS
from clutchid.observer.live import after_block, live_run, with_check_sentences
from fixtures.changed_logs import picked, spoiled

NONE = dict.fromkeys(LIVE_FLAGS, 0)


def followed(joint, log, sizes, left_out=NONE):
    run, parts, begin = live_run(joint, start(joint)), [], 0
    while begin < len(log):
        size = sizes[len(parts) % len(sizes)]
        run, part = after_block(run, log.slice(begin, begin + size), left_out)
        parts.append(part)
        begin += size
    return run, parts


def test_what_is_kept_does_not_grow(joint, log, monkeypatch):
    monkeypatch.setattr(module, "RECENT", 0.5)
    monkeypatch.setattr(module, "RECENT_STROKES", 1)
    run, _ = followed(joint, log, [100])
    assert len(run.parts) <= 7
    assert len(run.strokes) == 1
    assert len(run.recent().log) <= 700
    assert run.before.strokes == 0


def test_faults_are_added_up_block_by_block(joint, log):
    keep = np.setdiff1d(np.arange(len(log)), [500, 777, 778])
    torn = picked(spoiled(log, "position", slice(2000, 2100)), keep)
    run, _ = followed(joint, torn, [250], {**NONE, "late": 2, "unreadable": 1})
    assert run.health["position_missing"] == pytest.approx(0.1)
    assert run.health["lost"] == pytest.approx(3e-3)
    assert run.health["late"] == pytest.approx(2 * 24e-3)
    assert run.health["unreadable"] == pytest.approx(24e-3)
    assert run.health["time_missing"] == 0.0
    assert run.recent().seconds == pytest.approx(len(log) * joint.spacing)


def test_a_block_without_samples_only_counts(joint, log):
    run, _ = followed(joint, log.slice(0, 300), [150])
    after, part = after_block(run, log.slice(0, 0), {**NONE, "late": 7})
    assert len(part.log) == 0
    assert after.after.number == run.after.number
    assert after.health["late"] == pytest.approx(7e-3)


def test_the_metadata_are_those_of_the_last_part(joint, log):
    run, _ = followed(joint, replace(log.slice(0, 300), metadata={"origin_s": "1.0"}), [150])
    after, _ = after_block(run, replace(log.slice(300, 400), metadata={"origin_s": "-6.5"}), NONE)
    assert after.recent().log.metadata == {"origin_s": "-6.5"}


@pytest.mark.parametrize("sizes", [[100], [1700]])
def test_the_checks_look_at_the_first_samples_and_do_not_end_the_recording(joint, log, monkeypatch, sizes):
    monkeypatch.setattr(module, "CHECKED", 4.0)
    swapped = log.with_columns(duty_supply=log["duty_exhaust"], duty_exhaust=log["duty_supply"])
    run, parts = followed(joint, swapped, sizes)
    assert run.checked
    assert any("duty" in sentence for sentence in run.checked)
    assert len(parts) == -(-len(log) // sizes[0])
    assert run.recent().log.warnings == run.checked
    early, _ = followed(joint, swapped.slice(1000, 4000), sizes)
    assert early.checked is None
    assert with_check_sentences(early).checked is not None
