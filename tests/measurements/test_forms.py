"""One recording in forms that compose: read right, or refused in a sentence that names the feature."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))

from forms import FEATURES, Form, forms, outcome

PLAIN = [Form(format=name, layout="group" if name in ("asc", "candump") else "one") for name in FEATURES["format"]]


@pytest.mark.parametrize("form", PLAIN, ids=FEATURES["format"])
def test_the_plain_form_is_right_in_every_format(form):
    assert outcome(form) == ("right", "")


#: Pairs take minutes: `.ci/slow` asks for them.
PAIRS = pytest.mark.skipif("CLUTCHID_FORMS" not in os.environ, reason="CLUTCHID_FORMS=pairs runs them, in minutes")


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(2, marks=PAIRS)])
def test_a_form_with_one_or_two_features_is_right_or_refused_well(count):
    wrong = {form: why for _, form in forms(count) for result, why in [outcome(form)] if result == "wrong"}
    assert wrong == {}


@pytest.mark.slow
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
@given(
    st.builds(Form, **{name: st.sampled_from(values) for name, values in FEATURES.items()}).filter(lambda f: f.exists)
)
def test_any_composition_is_right_or_refused_well(form):
    result, why = outcome(form)
    assert result != "wrong", why
