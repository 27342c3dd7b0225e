"""Verdict on a fit: trust in its parameters and load, reasons, and states of wear of its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from clutchid.arguments import checked
from clutchid.estimation.assess.comparison import (
    ENGAGING,
    SHARES,
    WORTH,
    Measurement,
    comparison,
    measured,
)
from clutchid.estimation.assess.evidence import HORIZON, Reason, evidence, once_a_fit, reach
from clutchid.estimation.assess.pressure import pressure_notes
from clutchid.estimation.assess.reasons import bound_notes, reason_apart, reasons, valve_notes
from clutchid.estimation.assess.travel import unchecked_gains
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.identifiability import in_words
from clutchid.model.actuator import Actuator
from clutchid.systems import command_line

#: Probability that recordings of one state of wear are taken for several, as of a 95 % interval.
FALSE_ALARM = 0.05

#: Difference of the air's temperature between two recordings in K where it was not recorded, rms. A guess.
UNKNOWN_DIFFERENCE = 10.0

_NUMBERS = {2: "two", 3: "three", 4: "four", 5: "five"}


class ReadingDifference(NamedTuple):
    """Difference of two readings, the second less the first, and how much of it their errors allow.

    `load` is the relative change of the mean load over 5 to 8 mm, `shift` that of the half-load position in m.
    """

    first: str
    second: str
    load: float
    load_allowed: float
    shift: float
    shift_allowed: float

    @property
    def excess(self) -> float:
        """The larger difference over what is allowed: beyond 1 the readings are of two states of wear."""
        return max(abs(self.load) / self.load_allowed, abs(self.shift) / self.shift_allowed)


class WearStates(NamedTuple):
    """Recordings by state of wear, and the two of them that differ most."""

    groups: tuple[tuple[str, ...], ...]
    most: ReadingDifference


def states_of_wear(fit: Fit) -> WearStates | None:
    """The states of wear of the recordings of a fit, by its readings one by one; None if they do not differ.

    Notes
    -----
    What the calibration lacks changes all readings alike, so that only the independent part of their bands counts, and
    what a difference in temperature adds, `clutchid.estimation.assess.comparison.SHARES`. These shares are known as if
    from `WORTH` recordings, hence Student's t; with both measures of every pair of recordings the probability of a
    false alarm is at most `FALSE_ALARM` (Bonferroni). A recording joins the first group with none from which it
    differs.

    References
    ----------
    docs/derivations.md, "Two states of wear".
    """
    measured = {name: _measurement(reading) for name, reading in fit.readings.items()}
    values = {name: value for name, value in measured.items() if value is not None}
    pairs = {(a, b): _difference(a, b, values, _quantile(len(values))) for a, b in combinations(values, 2)}
    most = max(pairs.values(), key=lambda pair: pair.excess, default=None)
    if most is None or most.excess <= 1.0:
        return None
    groups: list[list[str]] = []
    for name in values:
        fits = (group for group in groups if all(pairs[other, name].excess <= 1.0 for other in group))
        own = next(fits, None)
        if own is None:
            groups.append([name])
        else:
            own.append(name)
    return WearStates(tuple(map(tuple, groups)), most)


def _measurement(reading: Fit) -> Measurement | None:
    """Measurement of the wear by a recording; None if its reading is not to be used."""
    (recording,) = reading.recordings.values()
    return (
        None if any(reason.grave for reason in reasons(reading)) else measured(comparison(reading), recording.measured)
    )


def _quantile(recordings: int) -> float:
    """Two-sided quantile of Student's t for the largest of two measures of every pair of recordings."""
    from scipy.special import stdtrit

    comparisons = max(1, recordings * (recordings - 1))  # two measures of half as many pairs
    return float(stdtrit(WORTH, 1.0 - FALSE_ALARM / (2 * comparisons)))


def _difference(a: str, b: str, values: Mapping[str, Measurement], quantile: float) -> ReadingDifference:
    reading, other = values[a], values[b]
    warmer = other.temperature - reading.temperature
    warmer = (warmer if np.isfinite(warmer) else UNKNOWN_DIFFERENCE) / 10.0

    def allowed(channel: str, first: float, second: float) -> float:
        """By the errors of two readings with these standard deviations."""
        shares = SHARES[channel]
        share = np.hypot(shares.independent, shares.by_temperature * warmer / np.sqrt(2.0))
        return quantile * float(share * np.hypot(first, second))

    return ReadingDifference(
        a, b, other.load - reading.load, allowed("load", reading.load_std, other.load_std),
        other.shift - reading.shift, allowed("shift", reading.shift_std, other.shift_std),
    )  # fmt: skip


def states_reasons(fit: Fit) -> list[Reason]:
    """That the recordings of a fit are of several states of wear, by how much they differ, and what to do."""
    states = states_of_wear(fit)
    if states is None:
        return []
    count, most = len(states.groups), states.most
    text = f"these recordings show {_NUMBERS.get(count, str(count))} states of wear"
    if len(fit.readings) > 2:
        text += f" ({'; '.join(in_words(list(group)) for group in states.groups)})"
    text += f": from {most.first} to {most.second} {' and '.join(_how_far(most))}. One load for all of them fits "
    return [
        Reason(f"{text}none of them: use the estimate of each recording, or follow the wear with {track_command(fit)}")
    ]


def _how_far(most: ReadingDifference) -> list[str]:
    begin, end = (f"{y * 1e3:.0f}" for y in ENGAGING)
    parts = []
    if abs(most.load) > most.load_allowed:
        verb, by, allowed = "rises" if most.load > 0.0 else "falls", 100 * abs(most.load), 100 * most.load_allowed
        parts.append(
            f"the load over {begin} to {end} mm {verb} by {by:.1f} % of the calibrated load (their bands explain up "
            f"to {allowed:.1f} %)"
        )
    if abs(most.shift) > most.shift_allowed:
        by, allowed = most.shift * 1e3, most.shift_allowed * 1e3
        parts.append(f"the half-load position moves by {by:+.2f} mm (their bands explain up to ±{allowed:.2f} mm)")
    return parts


def track_command(fit: Fit) -> str:
    """The command that follows the wear over the recordings of a fit, with the names of its files."""
    logs = [r.measured.metadata.get("source", r.measured.name) for r in fit.recordings.values()]
    return command_line(["clutchid", "track", *logs, "--start", _start(fit), "--out", "WEAR.parquet"])


def _start(fit: Fit) -> str:
    """The file of the calibration that a fit started from."""
    origin = fit.baseline.origin if fit.baseline else None
    return origin.name if origin and origin.name else "CAL.toml"


def nothing_in_common(readings: Mapping[str, Fit]) -> str:
    """Why recordings read one by one have no load in common, with the result of each; empty where they may have one."""
    why = {name: reason_apart(reading, len(readings)) for name, reading in readings.items()}
    if not any(why.values()):
        return ""
    two = {"another vehicle", ""} <= {*why.values()}
    head = "these recordings are of two vehicles" if two else "these recordings have no load in common"
    lines = (f"{name}: {_alone(reading, why[name])}" for name, reading in readings.items())
    return "\n".join([f"{head}, so each was estimated on its own.", *lines])


def _alone(reading: Fit, why: str) -> str:
    """Result of a recording read alone, or why it has none."""
    (recording,), start, curve = reading.recordings.values(), _start(reading), reading.load_curve
    if why == "not converged" and reading.departure:
        times, file = reading.departure.misfit, recording.measured.metadata.get("source", recording.measured.name)
        return (
            f"{why}, with a cost {times:.0f} times that of the calibration; leave the recording out, and look for "
            f"its fault: {command_line(['clutchid', 'look', file, '--start', start])}"
        )
    if why:
        return f"of {why} than {start}; use the calibration of that vehicle."
    at = curve.peak(reach(reading))
    load = f"at most {curve.force[at]:.0f} ± {(curve.high[at] - curve.low[at]) / 2:.0f} N"
    return f"of the vehicle of {start}, {load}, trust {verdict(reading).trust}."


Trust = Literal["good", "with care", "none"]

#: A load from position alone with the parameters of the paper: its error in % of the peak over 0.5 to 20 mm in the
#: median, and how many % of the points its band holds. Provenance: `python benchmarks/prove.py --trucks 24 --seed 1000
#: --workflow paper` prints 17.9 and 37.4, with `--family B` 21.9 and 38.3.
PAPER_OFF, PAPER_HELD = 18, 37

#: Note on the interval of a fit without a calibration.
NOISE_ONLY = "± includes only noise"

#: Meanings of the levels of trust.
_MEANING: Mapping[Trust, str] = {
    "good": "no reason to doubt the results was found; use them within their intervals.",
    "with care": "the load or its interval may be wrong for these reasons.",
    "none": "do not use these results.",
}


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a fit can be trusted, in sentences.

    Attributes
    ----------
    trust
        'good', 'with care' or 'none'.
    reasons
        Reasons that lower the trust, one sentence each; empty if it is good.
    unseen
        What this verdict cannot show, one sentence each.
    flawed
        Whether a reason concerns an error that the interval of the load does not contain.
    notes
        Findings that do not lower the trust, one sentence each.
    experience
        How far off loads without a calibration were on virtual trucks, in a sentence; empty for others.
    noise_only
        Whether the interval lacks the errors of assumed parameters, as without a calibration.

    Examples
    --------
    A second of driving gives a load to be used with care, and says why:

    >>> import clutchid
    >>> found = clutchid.fit(clutchid.bundled_recording().slice(0, 1000)).verdict
    >>> found.trust, len(found.reasons) > 0
    ('with care', True)
    """

    trust: Trust
    reasons: tuple[str, ...]
    unseen: tuple[str, ...] = ()
    flawed: bool = False
    notes: tuple[str, ...] = ()
    experience: str = ""
    noise_only: bool = False

    @property
    def meaning(self) -> str:
        """Meaning of the trust, in a sentence."""
        if self.noise_only and self.trust == "good":
            return (
                "no reason to doubt the results was found, provided that the parameters that were not fitted are "
                f"right: {NOISE_ONLY}."
            )
        return _MEANING[self.trust]


@checked
@once_a_fit
def verdict(fit: Fit) -> Verdict:
    """Whether the parameters and the load of a fit can be trusted.

    Parameters
    ----------
    fit : Fit
        Of any status and method.

    Returns
    -------
    verdict : Verdict
        'none' if the load is not determined at all, 'with care' if the load or its interval may be wrong.

    Notes
    -----
    The interval is too narrow if residuals are autocorrelated, correlate with a valve, and correspond to a
    load larger than the width of the interval. If the position follows the measurement, as in multiple shooting, this
    is tested with the pressure only. A load from position alone is judged by how far the recording departs from the
    calibration, `clutchid.estimation.assess.reasons`: bounds and simulated positions did not indicate its error.

    Examples
    --------
    A calibration by the paper's method with the piston at rest determines nothing:

    >>> import numpy as np
    >>> from clutchid import fit
    >>> from clutchid.log import Log
    >>> t = np.arange(0.0, 1.0, 1e-3)
    >>> still = Log(t, {name: np.zeros(1000) for name in ("position", "duty_supply", "duty_exhaust")})
    >>> verdict(fit(still, force=True)).trust
    'none'
    """
    against = (*states_reasons(fit), *reasons(fit))
    trust: Trust = "none" if any(r.grave for r in against) else "with care" if against else "good"
    flawed = any(reason.grave and not reason.banded for reason in against)
    texts = tuple(reason.text for reason in against)
    if fit.status == "failed" or not fit.recordings:
        return Verdict(trust, texts, flawed=flawed)
    notes = (*pressure_notes(fit), *bound_notes(fit), *valve_notes(fit, evidence(fit)))
    return Verdict(
        trust, texts, (*unchecked_gains(fit), *_unseen(fit)), flawed, notes, _experience(fit), noise_only(fit)
    )


def noise_only(fit: Fit) -> bool:
    """Whether the interval of a load lacks the errors of what is assumed: there is no calibration."""
    return fit.status != "failed" and fit.load_is_fitted and fit.baseline is None and fit.calibration is None


def of_the_paper(fit: Fit) -> bool:
    """Whether every parameter that was not fitted has its value from Appendix A."""
    fixed = [name for name in fit.actuator.parameter_names if name not in fit.parameters]
    return all(fit.actuator.value(name) == fit.actuator.default(name) for name in fixed)


def _as_in_the_paper(fit: Fit) -> bool:
    """Whether the load alone is fitted to the position alone, by the method, the model and the truck of the paper."""
    load_alone = set(fit.parameters) <= set(fit.actuator.load.names) and fit.actuator.load.basis == "paper"
    by_position = fit.method == "simulation" and "pressure_a" not in fit.scales
    return load_alone and by_position and fit.actuator.model == Actuator().model and of_the_paper(fit)


def _experience(fit: Fit) -> str:
    """How far off loads without a calibration were on virtual trucks, in a sentence; empty for others."""
    if not noise_only(fit):
        return ""
    if not _as_in_the_paper(fit):
        return f"{NOISE_ONLY}, not errors of the assumed parameters."
    return (
        f"{NOISE_ONLY}: on virtual trucks the median error of such a load was {PAPER_OFF} % of its peak, and its "
        f"band contained {PAPER_HELD} % of the points."
    )


def _unseen(fit: Fit) -> tuple[str, ...]:
    if not fit.follows:
        return ()
    steps = {"shooting": ("multiple shooting", "window", "windows")}
    how, unit, units = steps.get(fit.method, ("a fit by prediction error", "sample", "samples"))
    pressure = "the measured pressure and " if "pressure_a" in fit.scales else ""
    return (
        f"in {how} the position follows the measurement from {unit} to {unit}, so its residual does not test the "
        f"model; the steps between {units} would. The verdict uses {pressure}the position simulated for {HORIZON:g} "
        "s at a time.",
    )
