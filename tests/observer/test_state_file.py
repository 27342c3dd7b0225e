"""The file of a state: a change of any entry is noticed, and a state that is not finite is refused."""

import os
import subprocess
import sys

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.inference.filter.setup import ADAPTS, WEARS
from clutchid.observer import observe, read_state, start, write_state
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_state_file")


@pytest.fixture(scope="module")
def state(joint, log):
    return observe(joint, start(joint), log.slice(0, 700))[0]


def spoiled(values, value):
    """An array whose last element is another."""
    other = np.array(values)
    other[(-1,) * other.ndim] = value
    return other


@pytest.mark.parametrize(("before", "after"), CASES["a_changed_entry_is_noticed_by_the_checksum"])
def test_a_changed_entry_is_noticed_by_the_checksum(joint, state, tmp_path, before, after):
    path = tmp_path / "state.toml"
    write_state(joint, state, path)
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(ParameterError, match=r"state\.toml: the observer state is damaged \(it was changed"):
        read_state(joint, path)


@pytest.mark.slow
def test_a_state_belongs_to_its_calibration_in_every_process():
    script = """
import numpy as np
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.model import Actuator
from clutchid.observer import observer
from clutchid.observer.state_file import fingerprint
conditions = RecordedConditions(temperature=290.0, supply=9e5, supply_estimated=9e5)
print(fingerprint(observer(Actuator(), calibration=Calibration((), np.zeros((0, 0)), conditions=conditions))))
"""
    environments = ({**os.environ, "PYTHONHASHSEED": seed} for seed in "123")
    prints = {subprocess.check_output([sys.executable, "-c", script], env=env, text=True) for env in environments}
    assert len(prints) == 1


def test_other_blanks_comments_and_line_ends_are_no_change(joint, state, tmp_path):
    path = tmp_path / "state.toml"
    write_state(joint, state, path)
    path.write_bytes(b"# mine\r\n" + path.read_bytes().replace(b"\n", b"\r\n").replace(b" = ", b"  =  "))
    assert np.array_equal(read_state(joint, path).T, state.T)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda s: {"T": spoiled(s.T, np.nan)}, "a value of its filter is not finite"),
        (lambda s: {"theta": s.theta + np.inf}, "a value of its filter is not finite"),
        (lambda s: {"filter": s.filter._replace(x=spoiled(s.filter.x, np.nan))}, "a value of its filter is not finite"),
        (lambda s: {"T": s.T[:, :-1]}, "cannot reshape"),
        (lambda _: {"excess": "a"}, "could not convert string to float"),
    ],
)
def test_a_state_of_a_filter_that_diverged_or_of_another_shape_is_refused(joint, state, tmp_path, change, reason):
    write_state(joint, state._replace(**change(state)), tmp_path / "state.toml")
    with pytest.raises(ParameterError, match="the observer state is damaged") as caught:
        read_state(joint, tmp_path / "state.toml")
    assert reason in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_correction_of_any_kind_that_is_under_way_is_read(joint, state, tmp_path):
    for due in (0, 1, 1 + ADAPTS, 1 + WEARS, 1 + ADAPTS + WEARS):
        saved = state._replace(filter=state.filter._replace(due=np.array([due])))
        write_state(joint, saved, tmp_path / "state.toml")
        assert read_state(joint, tmp_path / "state.toml").filter.due == due
