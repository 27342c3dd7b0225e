"""A parameter of an own model has the same entries as one of the package, and the same is done with it."""

import hashlib
import json
from pathlib import Path

import pytest
from sympy import srepr, symbols

from clutchid.errors import ParameterError
from clutchid.estimation.automatic import freed
from clutchid.inference.uncertainty.calibration import consider_parameters
from clutchid.inference.uncertainty.change_prior import change_covariance, changeable, directions
from clutchid.model import Actuator, GroupChange, OwnModel, OwnParameter, own_model
from clutchid.observer.methods import METHODS
from clutchid.observer.prior import online_prior

EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"

y, f_s, c_r, F_r = symbols("y f_s c_r F_r", real=True)


def spring(**entries):
    """The paper's model with a return spring; `entries` of the row of its stiffness."""
    usual = {"std": 2e3, "drift": 20.0}
    stiffness = OwnParameter(4e3, "N/m", "stiffness of the return spring", range=(0, 1e5), **{**usual, **entries})
    preload = OwnParameter(50, "N", "preload of the return spring", range=(0, 1e3))
    return OwnModel("isothermal", parameters={"c_r": stiffness, "F_r": preload}, terms={"f_s": f_s + F_r + c_r * y})


def actuator(**entries):
    return Actuator(model=spring(**entries))


def considered(variant):
    return {c.base: c.width for c in consider_parameters(variant, (), None)[0]}


def test_by_default_one_with_a_spread_is_freed_and_one_with_a_drift_may_change():
    assert set(freed(actuator())) & {"c_r", "F_r"} == {"c_r"}
    assert set(changeable(actuator())) & {"c_r", "F_r"} == {"c_r"}
    assert not {"c_r", "F_r"} & set(METHODS["joint"].adapting(actuator()))
    assert all(not row.changes for name, row in actuator().rows.items() if name in ("c_r", "F_r"))


def test_one_with_a_spread_stays_fixed_where_its_row_says_so():
    assert "c_r" not in freed(actuator(freed=False))


def test_its_drift_is_part_of_the_uncertainty_where_it_is_fixed():
    assert considered(actuator())["c_r"] == pytest.approx(20.0)
    assert "F_r" not in considered(actuator())


def test_a_drift_that_is_considered_is_not_estimated():
    variant = actuator(considered=True)
    assert "c_r" not in changeable(variant)
    assert considered(variant)["c_r"] == pytest.approx(20.0)


def test_it_changes_with_its_group():
    variant = actuator(changes=(GroupChange("temperature and grease", -300.0, "warmer"), GroupChange("valves", 50.0)))
    assert directions(variant.rows, "temperature and grease")[0]["c_r"] == -300.0
    assert {"c_r": 50.0} in directions(variant.rows, "valves")
    covariance = change_covariance(variant, ("T_0", "c_r"), ("temperature and grease",))
    assert covariance[1, 1] == pytest.approx(300.0**2 + 20.0**2)
    assert covariance[0, 1] == pytest.approx(-300.0 * 0.085 * 293.0)


def test_it_adapts_on_line_by_its_own_standard_deviation():
    variant = actuator(adapts=100.0)
    names = METHODS["joint"].adapting(variant)
    assert names[-1] == "c_r"
    prior = online_prior(variant, names)
    at = [c.base for c in prior.free].index("c_r")
    assert prior.free[at].slope(0.0) == pytest.approx(100.0)
    assert prior.root[at, at] == pytest.approx(1.0), "apart from the load"


def test_what_has_no_effect_does_not_adapt():
    slip = Actuator(model=own_model(EXAMPLES / "maxwell_slip.py", "maxwell_slip"))
    assert "F_C" not in METHODS["joint"].adapting(slip), "its elements have slip forces of their own"
    assert "s_pwm" not in METHODS["joint"].adapting(Actuator().replace({"T_pwm": 0.02})), "the paper's valves"
    switched = Actuator(model="energy-balance").replace({"T_pwm": 0.02})
    assert METHODS["joint"].adapting(switched)[-1] == "s_pwm"


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"changes": (GroupChange("valve", 1.0),)}, "parameter c_r: changes: no group 'valve'; did you mean 'valves'?"),
        ({"changes": [GroupChange("valves", 1.0)]}, "a tuple of GroupChange(GROUP, STD) is needed."),
        ({"changes": (("valves", 1.0),)}, "a tuple of GroupChange(GROUP, STD) is needed."),
        ({"changes": (GroupChange("valves", "much"),)}, "changes, valves, std = 'much': a number is needed."),
        ({"changes": (GroupChange("valves", float("inf")),)}, "changes, valves, std = inf: it must be finite."),
        ({"adapts": 0.0}, "adapts = 0.0 N/m: the standard deviation of a change on line is above 0 and finite."),
        ({"adapts": "yes"}, "adapts = 'yes': a number is needed."),
    ],
)
def test_entries_that_cannot_be_right_are_refused(entries, words):
    with pytest.raises(ParameterError) as caught:
        spring(**entries)
    assert words in str(caught.value)


def test_each_entry_counts_in_the_hash_of_the_model_and_the_defaults_do_not():
    others = [{"freed": False}, {"considered": True}, {"adapts": 1.0}, {"changes": (GroupChange("valves", 1.0),)}]
    assert len({spring().sha256, *(spring(**entries).sha256 for entries in others)}) == 5
    # models of files that were written before these entries
    rows = [
        ["c_r", {"default": 4e3, "unit": "N/m", "range": [0.0, 1e5], "std": 2e3, "drift": 20.0}],
        ["F_r", {"default": 50.0, "unit": "N", "range": [0.0, 1e3], "std": None, "drift": 0.0}],
    ]
    terms = [["f_s", srepr(f_s + F_r + c_r * y)]]
    before = {"base": "isothermal", "without": [], "parameters": rows, "states": [], "terms": terms, "rates": []}
    assert spring().sha256 == hashlib.sha256(json.dumps(before).encode()).hexdigest()
