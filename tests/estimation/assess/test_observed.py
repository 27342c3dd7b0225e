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

#: Indicators of a load without any fault.
GOOD = Indicators(True, 12, 0.03, 1.1, dict.fromkeys(FLAGS, 0.0), "measured")


@pytest.mark.parametrize(
    ("change", "trust", "reason"),
    [
        ({}, "good", None),
        ({"strokes": 1}, "with care", "1 stroke has ended, fewer than 2"),
        ({"strokes": 0}, "none", "no stroke has ended"),
        ({"adapts": False}, "none", "the load does not adapt with this method"),
        ({"half_width": 0.15}, "with care", "± 15 % of the peak, wider than the limit of ± 10 %"),
        ({"half_width": 0.4}, "none", "± 40 % of the peak"),
        ({"half_width": np.nan}, "none", "is infinite, wider"),
        ({"mismatch": np.nan}, "good", None),
        ({"mismatch": 1.7}, "with care", "1.7 times those of the calibration recordings"),
        ({"mismatch": 2.5}, "none", "2.5 times those of the calibration recordings"),
        ({"flagged": {"position_missing": 0.1}}, "good", None),
        ({"flagged": {"position_missing": 0.3}}, "with care", "the position is missing (30 % of the time)"),
        ({"flagged": {"duty_missing": 0.9}}, "none", "a duty cycle is missing"),
        ({"flagged": {"position_frozen": 0.9}}, "good", None),
        ({"flagged": {"leak": 0.01}}, "with care", "leaks (1 % of the time)"),
        ({"flagged": {"diverged": 0.001}}, "with care", "started again (0.1 % of the time)"),
        ({"flagged": {"leak": 0.997}}, "with care", "leaks (100 % of the time)"),
        ({"supply": "not recorded"}, "with care", "and the band allows for it; record it."),
        ({"supply": "not used"}, "with care", "the supply pressure was not used"),
        ({"unvented": (Reason("no rest"),)}, "with care", "no rest"),
        ({"pressure": PressureTest(4e3, 3e3, 5e3)}, "good", None),
        (
            {"pressure": PressureTest(10e3, 3e3, 8e3)},
            "with care",
            "differs from the estimated one by 10.0 kPa rms, more",
        ),
        ({"pressure": PressureTest(20e3, 3e3, 8e3)}, "none", "more than its sensor and its band allow"),
        ({"flagged": {"travel_unlike": 0.01}}, "with care", "travels further than in the calibration"),
        (
            {"flagged": {"travel_unlike": 0.01}, "travel": travel_change(Travel(0.023), Travel(0.026))},
            "with care",
            "26.0 mm, 23.0 mm in the calibration: the gain of the position may be too large",
        ),
        ({"travel": travel_change(Travel(0.023, 0.025), Travel(0.02, 0.0225))}, "with care", "0.90 times that of then"),
        (
            {"kept_shift": 3e-4},
            "with care",
            "the vented rest has moved by +0.30 mm since the calibration, and was kept",
        ),
    ],
)
def test_the_trust_falls_with_each_indicator_and_says_why(change, trust, reason):
    verdict = observed_verdict(GOOD._replace(**change))
    assert verdict.trust == trust
    assert len(verdict.reasons) == (reason is not None)
    assert reason is None or reason in verdict.reasons[0]


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
