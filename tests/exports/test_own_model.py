"""A calibration with the user's own equations is exported as one of a variant is."""

import sys
from pathlib import Path

import pytest

from clutchid import Actuator, Load
from clutchid.exports.c99 import CStyle
from clutchid.exports.exporting import write_export
from clutchid.exports.parity import begun
from clutchid.observer import observer, start

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


@pytest.mark.parametrize("real", ["double", "float"])
def test_an_observer_with_own_friction_and_own_states_computes_in_c_what_it_does_in_python(
    real, tmp_path, monkeypatch, recorded_by
):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    from maxwell_slip import maxwell_slip

    estimator, style = observer(Actuator(model=maxwell_slip, load=Load())), CStyle("own", real, "one")
    log = recorded_by(estimator.actuator, seconds=4.0)
    export = write_export(estimator, begun(estimator, start(estimator)), tmp_path, style, "own model", check=[log])
    sys.modules.pop("maxwell_slip", None)
    assert export.parity is not None
    assert export.parity.flags == {}
    assert export.parity.holds(style)
