"""The view of a recording that goes on: it fits the terminal, and shows what is known."""

import numpy as np
import pytest

from clutchid.documents.observe_view import observe_view
from clutchid.observer import observer, start
from clutchid.observer.health import LIVE_FLAGS
from clutchid.observer.live import after_block, live_run

NONE = dict.fromkeys(LIVE_FLAGS, 0)


@pytest.fixture(scope="module")
def followed(plant, recorded_by):
    """An observer that has followed a worn actuator block by block, and the last block."""
    worn = plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names})
    log, estimator = recorded_by(worn, seconds=6.0), observer(plant)
    run = live_run(estimator, start(estimator))
    for begin in range(0, len(log), 1000):
        run, part = after_block(run, log.slice(begin, begin + 1000), NONE)
    return run, part


@pytest.mark.parametrize("width", [40, 80, 300])
def test_it_fits_the_terminal_in_plain_characters(followed, width):
    lines = observe_view(*followed, width).splitlines()
    assert max(map(len, lines)) <= width
    assert len(lines) <= 20
    assert all(line.isascii() for line in lines)


def test_the_larger_load_of_a_worn_clutch_stands_above_the_calibrated_one(followed):
    rows = [line.partition("|")[2] for line in observe_view(*followed, 80).splitlines() if "|" in line]
    columns = ["".join(column) for column in zip(*(row.ljust(80) for row in rows), strict=True)]
    both = [column for column in columns if "*" in column and "o" in column]
    assert len(both) > 10
    assert all(column.index("*") < column.index("o") for column in both)


def test_flags_are_listed_and_an_unknown_pressure_is_said(followed):
    run, part = followed
    backwards = part.log["position"][::-1].copy()
    torn = part.log.with_columns(duty_supply=np.full(len(part.log), np.nan), position=backwards)
    later = type(torn)(torn.time + 1.0, torn.columns, torn.name)
    view = observe_view(*after_block(run, later, {**NONE, "late": 3}), 80)
    assert "pressure unknown" in view
    assert "flags: duty_missing 1 s, late 0.003 s" in view
