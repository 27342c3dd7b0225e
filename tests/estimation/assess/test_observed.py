"""Trust in the load of an observer."""

import numpy as np
import pytest

from clutchid.estimation.assess.evidence import Reason
from clutchid.estimation.assess.observed import FLAGGED, Indicators, indicators, observed_verdict
from clutchid.estimation.assess.pressure import PressureTest
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.observer import observe_recording, observer
from clutchid.observer.health import FLAGS
from clutchid.strokes.travel import Travel, travel_change, travel_of
from fixtures.cases import case_tables

#: Indicators of a load without any fault.
GOOD = Indicators(True, 12, 0.03, 1.1, dict.fromkeys(FLAGS, 0.0), "measured")


#: How the indicators of a table are made, where they are no numbers.
MADE = {
    "pressure": lambda values: PressureTest(*values),
    "travel": lambda both: travel_change(*(Travel(*travel) for travel in both)),
    "unvented": lambda reason: (Reason(reason),),
}


@pytest.mark.parametrize(("change", "trust", "reason"), case_tables(__file__, "trust")["indicators"])
def test_the_trust_falls_with_each_indicator_and_says_why(change, trust, reason):
    made = {name: MADE[name](value) if name in MADE else value for name, value in change.items()}
    verdict = observed_verdict(GOOD._replace(**made))
    assert verdict.trust == trust
    assert len(verdict.reasons) == (reason != "")
    assert reason in "".join(verdict.reasons)


def test_a_gain_that_cannot_be_checked_is_what_the_verdict_does_not_see():
    (unseen,) = observed_verdict(GOOD._replace(travel=travel_change(Travel(0.023), Travel(0.023)))).unseen
    assert "the gain of the position cannot be checked here" in unseen
    stop = Travel(0.023, 0.025)
    assert observed_verdict(GOOD._replace(travel=travel_change(stop, stop))).unseen == ()


def test_a_measured_pressure_and_the_travel_test_a_recording_that_has_ended(plant, recorded_by):
    log = recorded_by(plant, seconds=6.0)
    calibration = Calibration((), np.zeros((0, 0)), travel=travel_of(log))
    joint = observer(plant, calibration=calibration)
    sound, lower, longer = (
        observed_verdict(indicators(observe_recording(joint, changed)))
        for changed in (
            log,
            log.with_columns(pressure_a=log["pressure_a"] - 6e4),
            log.with_columns(position=1.1 * log["position"]),
        )
    )
    assert not any("pressure_a" in reason or "travels" in reason for reason in sound.reasons)
    assert any("more than its sensor" in reason for reason in lower.reasons)
    assert any("the gain of the position may be too large" in reason for reason in longer.reasons)


def test_the_worst_of_several_reasons_decides_and_all_are_said():
    verdict = observed_verdict(GOOD._replace(strokes=0, supply="not recorded"))
    assert (verdict.trust, len(verdict.reasons)) == ("none", 2)


def test_every_limit_is_of_a_flag_that_exists():
    assert set(FLAGGED) <= {*FLAGS}


def test_the_indicators_are_those_of_the_end_of_the_recording(plant, recorded_by):
    log = recorded_by(plant, seconds=6.0)
    torn = log.with_columns(position=np.where(np.arange(len(log)) < 600, np.nan, log["position"]))
    indicated = indicators(observe_recording(observer(plant), torn))
    assert indicated.adapts
    assert indicated.supply == "not recorded"
    assert indicated.flagged["position_missing"] == pytest.approx(600 / len(log))
    begin = indicators(observe_recording(observer(plant), log.slice(0, 2)))
    assert indicated.half_width < begin.half_width, "the band becomes narrower"
    short = indicators(observe_recording(observer(plant), log.slice(0, 100)))
    assert short.strokes == 0
    assert indicators(observe_recording(observer(plant, "states"), log)).adapts is False
