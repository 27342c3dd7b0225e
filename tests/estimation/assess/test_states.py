"""States of wear: readings that differ by more than the independent part of their bands allows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from clutchid.estimation import LoadCurve
from clutchid.estimation.assess.comparison import SHARES, WORTH, comparison, measured
from clutchid.estimation.assess.verdict import FALSE_ALARM, UNKNOWN_DIFFERENCE, states_of_wear
from fixtures.baselines import ORIGIN, with_baseline

#: Half width of the band of a load, as a share of it.
HALF = 0.03


@pytest.fixture
def reading(short_fit):
    """A reading from a calibration: its load is `factor` times that of the calibration."""

    def make(name, factor=1.0, temperature=None, trust="good"):
        (recording,) = short_fit.recordings.values()
        log = replace(recording.measured, name=name)
        if temperature is not None:
            log = log.with_columns(temperature_ambient=np.full(len(log), temperature))
        curve = short_fit.load_curve
        loads = (factor * curve.force * (1.0 + side * HALF) for side in (0, -1, 1))
        read = replace(
            short_fit, load_curve=LoadCurve(curve.position, *loads), recordings={name: replace(recording, measured=log)}
        )
        return with_baseline(read, share=1.0, origin=ORIGIN._replace(trust=trust))

    return make


def together(*readings):
    """A fit of all of them, with the readings one by one."""
    names = {next(iter(fit.recordings)): fit for fit in readings}
    return replace(readings[0], recordings={n: fit.recordings[n] for n, fit in names.items()}, readings=names)


def allowed(first, second, warmer=UNKNOWN_DIFFERENCE, recordings=2):
    """What the errors of two readings allow the load to differ by, at the level of all comparisons together."""
    deviations = [
        measured(comparison(fit), next(iter(fit.recordings.values())).measured).load_std for fit in (first, second)
    ]
    share = np.sqrt(SHARES["load"].independent ** 2 + (SHARES["load"].by_temperature * warmer / 10.0) ** 2 / 2)
    comparisons = recordings * (recordings - 1)
    return stats.t(WORTH).ppf(1.0 - FALSE_ALARM / (2 * comparisons)) * share * np.hypot(*deviations)


@pytest.mark.parametrize("sign", [-1, 1])
def test_readings_are_of_two_states_where_their_loads_differ_by_more_than_their_bands_allow(reading, sign):
    first = reading("new")
    limit = allowed(first, first)
    # the band is a share of the load: with it the limit moves by half of the difference's own share at most
    assert states_of_wear(together(first, reading("worn", 1.0 + sign * 0.9 * limit))) is None
    states = states_of_wear(together(first, reading("worn", 1.0 + sign * 1.1 * limit)))
    assert states.groups == (("new",), ("worn",))
    assert (states.most.first, states.most.second) == ("new", "worn")
    assert states.most.load == pytest.approx(sign * 1.1 * limit)
    assert states.most.load_allowed == pytest.approx(limit, rel=limit)


def test_a_recorded_temperature_counts_by_its_difference(reading):
    for warmer in (0.0, 20.0):
        first, second = reading("new", 1.0, 290.0), reading("worn", 1.5, 290.0 + warmer)
        assert states_of_wear(together(first, second)).most.load_allowed == pytest.approx(
            allowed(first, second, warmer)
        )


def test_three_readings_are_grouped_and_the_two_that_differ_most_are_named(reading):
    states = states_of_wear(together(reading("a"), reading("b", 1.3), reading("c", 1.01), reading("d", 1.6)))
    assert states.groups == (("a", "c"), ("b",), ("d",))
    assert (states.most.first, states.most.second) == ("a", "d")


def test_a_reading_that_is_not_to_be_used_is_of_no_state(reading):
    worn = reading("worn", 1.5, trust="none")
    assert worn.verdict.trust == "none"
    assert states_of_wear(together(reading("new"), worn)) is None


def test_one_reading_and_none_have_no_states(short_fit, reading):
    assert states_of_wear(short_fit) is None
    assert states_of_wear(together(reading("new"))) is None


def test_two_states_are_the_first_reason_and_take_the_good_trust_and_offer_to_follow_the_wear(reading):
    same = together(reading("new"), reading("also new", 1.001))
    assert (same.verdict.trust, same.verdict.reasons) == ("good", ())
    judged = together(reading("new"), reading("worn", 1.2)).verdict
    assert judged.trust == "with care"
    assert judged.reasons[0].startswith(
        "these recordings show two states of wear: from new to worn the load over 5 to 8 mm rises by 20.0 % of the "
        "calibrated load (their bands explain up to "
    )
    assert judged.reasons[0].endswith("clutchid track new worn --start CAL.toml --out WEAR.parquet")
    several = together(reading("a"), reading("b", 1.5), reading("c")).verdict.reasons[0]
    assert several.startswith("these recordings show two states of wear (a and c; b): from a to b ")
