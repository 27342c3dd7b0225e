"""The file of a state: a change of any entry is noticed, and what no observer writes is refused."""

import os
import subprocess
import sys

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.inference.filter.setup import ADAPTS, WEARS
from clutchid.observer import observe, read_state, start, write_state
from clutchid.observer.mismatch import mismatch_from
from fixtures.cases import case_tables
from fixtures.observing import with_inputs

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


def inputs(**records):
    """Other values in the records of the inputs."""
    return lambda state: {"inputs": with_inputs(state, **records).inputs}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda s: {"T": spoiled(s.T, np.nan)}, "parameters has a value that is not finite"),
        (lambda s: {"T": s.T[:, :-1]}, "cannot reshape"),
        (lambda s: {"T": s.T.T, "filter": s.filter._replace(T=s.T.T)}, "a root is not lower triangular"),
        (lambda _: {"wear": np.array([-1])}, "the remaining gain of the parameters is below 0"),
        (lambda _: {"wear": np.array([5])}, "a pending correction"),
        (lambda s: {"sound": s.sound._replace(wear=np.array([-1]))}, "the remaining gain of the parameters is below 0"),
        *(
            (lambda s, due=due: {"filter": s.filter._replace(due=np.array([due]))}, "a pending correction")
            for due in (-1, 2, 4, 6, 8)
        ),
        (lambda s: {"T": 0.0 * s.T, "filter": s.filter._replace(T=0.0 * s.T)}, "a root has a row of zeros"),
        (lambda s: {"theta": s.theta + 1.0}, "the parameters are not those of filter"),
        (lambda s: {"sound": s.sound._replace(theta=s.theta + np.inf)}, "sound has a value that is not finite"),
        (lambda s: {"filter": s.filter._replace(S=0.0 * s.filter.S)}, "S is 0"),
        (lambda s: {"filter": s.filter._replace(x=spoiled(s.filter.x, np.nan))}, "filter has a value that is not"),
        (lambda s: {"filter": None}, "do not belong together"),
        (lambda _: {"number": -5}, "number is not a number of at least 0"),
        (lambda _: {"number": 0.5}, "number is not a number of at least 0"),
        (lambda _: {"nis": mismatch_from(-1.0)}, "mismatch -1 is not at least 0"),
        (lambda _: {"excess": "1"}, "excess is no number"),
        (lambda _: {"leaking": 1}, "leaking is neither true nor false"),
        (lambda _: {"zero": 7.0}, "has moved by more than 0.005 m"),
        (lambda s: {"deviations": spoiled(s.deviations, -1.0)}, "a standard deviation is below 0"),
        (lambda _: {"strokes": -1}, "strokes is not a number of at least 0"),
        (lambda s: {"tail": s.tail._replace(time=spoiled(s.tail.time, np.nan))}, "tail has a value that is not finite"),
        (lambda s: {"tail": s.tail._replace(time=s.tail.time[::-1])}, "the times of tail do not increase"),
        (lambda s: {"tail": s.tail._replace(duties=spoiled(s.tail.duties, 7.0))}, "a duty cycle of tail is outside"),
        (lambda s: {"tail": s.tail._replace(position=s.tail.position[1:])}, "different lengths"),
        (inputs(intake={"unzeroed": 1}), "the zero of the position is unknown, but it has not jumped"),
        (inputs(intake={"driven": 2}), "a mark is neither 0 nor 1"),
        (inputs(intake={"air": 5.0}), "is not a temperature of air"),
        (inputs(rest={"shift": np.nan}), "has moved by more than 0.005 m"),
        (inputs(rest={"lowest": 1e300}), "a vented rest lies above 0.003 m"),
        (inputs(rest={"n_returned": 9}), "more samples of a vented rest are stored than is possible"),
        (inputs(rest={"n_bin": 10}), "more samples of a vented rest are stored than is possible"),
        (lambda s: {"inputs": s.inputs._replace(bin=s.inputs.bin + np.inf)}, "rest has a value that is not finite"),
        (inputs(rest={"vents": -1}), "vents is not a number of at least 0"),
    ],
)
def test_a_value_that_no_observer_has_is_refused_whatever_the_checksum(joint, state, tmp_path, change, reason):
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
