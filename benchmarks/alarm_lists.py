"""Lists of alarms of a DRAWN fleet: by the posteriors of the trend, and by e-detectors with e-BH.

    python benchmarks/alarm_lists.py --vehicles 1000                            (a recording a week, a year)
    python benchmarks/alarm_lists.py --vehicles 1000 --months 42 --days 90 --shares 0.01
    python benchmarks/alarm_lists.py --vehicles 1000 --estimated                (share of outliers of the fleet)

Vehicles as in `wear_drawn.py`; clutches are replaced as in service, and the load of one vehicle in five jumps by 3, 6
or 12 standard deviations of the scatter of its readings, in any direction of shift and load; outliers miss by 8. Lists:

posterior: changes with a probability of 0.95 at the end of the time by `wear/trend.py`, as if a decision that is final
    were right, as it was until the list was made.
list: the largest list, best first, whose expected share of false ones is at most 0.1, from probabilities that count
    what was lost with decisions; it also has changes that the next readings decide.
e-BH: innovations of a filter that leaves out what it does not expect; M, the sum of likelihood ratios of a jump at one
    of the last three readings; in the list of a week are the k largest with M of at least K / (0.1 k) (arXiv
    2501.04130), and here those in the list of any week.

In brackets: share in the list by one reading after the event.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from wear_drawn import MEASURED, Truth, drawn, fleet_parser, table_of, truth

from clutchid.estimation.assess.comparison import SHARES_BY, WORTH, Measurement
from clutchid.log import FloatArray
from clutchid.truck.service import Visit, visits
from clutchid.wear import trend
from clutchid.wear.alarms import CHANGED, POSSIBLE
from clutchid.wear.trend import CHANGE_OUTCOMES, CHANNELS, GROWTH, LIFE, REFERENCE, growth_noise

#: Sizes of jumps and of an outlier, in standard deviations of the scatter of a reading; share of vehicles that jump.
SIZES, ODD, JUMPING = (3.0, 6.0, 12.0), 8.0, 0.2

#: Of the e-detector: size of a jump and of an outlier in standard deviations, readings after a start, and e-BH's level.
#: Chosen on types 4 to 7, seed 41.
TAU, WIDE, SPAN, SHARE = 4.0, 8.0, 3, 0.1


class DrawnLife(NamedTuple):
    """Places and measurements of a vehicle, and its events: recording from which on, and size (0: replaced)."""

    s: FloatArray
    measurements: list[Measurement | None]
    events: dict[int, float]


class ListedAlarm(NamedTuple):
    """An alarm: vehicle, recording, probability that it is none, and recording at which it was listed first."""

    vehicle: int
    recording: int
    false: float
    listed: int


def life(service: Sequence[Visit], true: Truth, odd: float, random: np.random.Generator) -> DrawnLife:
    """A vehicle with its events and outliers."""
    spreads = np.array([errors.std * errors.own for errors in MEASURED[service[0].family]])
    values = np.array([true.shift, true.load])
    events = {k: 0.0 for k, visit in enumerate(service) if visit.event == "clutch replaced" and k}
    if random.uniform() < JUMPING:
        k, size = int(random.integers(3, len(service) - 1)), float(random.choice(SIZES))
        end = min((j for j in events if j > k), default=len(service))
        if all(abs(k - j) > 2 for j in events):
            values[:, k:end] += (size * spreads * _direction(random))[:, None]
            events[k] = size
    for k in np.flatnonzero(random.uniform(size=len(service)) < odd):
        values[:, k] += ODD * spreads * _direction(random)
    readings = drawn(service, true._replace(shift=values[0], load=values[1]), 0.0, random)
    s = np.array([visit.strokes for visit in service])
    return DrawnLife(s, [reading.measurement for reading in readings], events)


def _direction(random: np.random.Generator) -> FloatArray:
    angle = random.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def posteriors(number: int, vehicle: DrawnLife, count: int | None = None) -> tuple[list[ListedAlarm], FloatArray]:
    """Changes among the first recordings by the trend, and how many outliers of how many measurements there are.

    Without the probability that a decision which is final was right, as before, a change is listed first at -1.
    """
    s, measurements = vehicle.s[:count], vehicle.measurements[:count]
    paths = trend.traced(trend.trend_model(LIFE["strokes"]), s, measurements)
    measured = [k for k, now in enumerate(measurements) if now is not None]
    alarms = []
    for k, verdict in enumerate(trend.verdicts(paths)):
        if verdict.change > 0.0:
            alarms.append(ListedAlarm(number, k, 1.0 - verdict.change, len(s)))
        if verdict.outcome in CHANGED:
            share = trend.probability(paths, [*range(max(k - 1, 0), min(k + 2, len(s)))], CHANGE_OUTCOMES)
            alarms.append(ListedAlarm(number, k, 1.0 - share, -1))
    outliers = sum(trend.probability(paths, [k], ("left out",)) for k in measured)
    return alarms, np.array([outliers, len(measured)])


def detected(lives: Sequence[DrawnLife], outlier: float) -> tuple[FloatArray, FloatArray]:
    """M by recording and vehicle, and how many recordings before its likeliest jump was."""
    count, longest = len(lives), max(len(vehicle.s) for vehicle in lives)
    s, values, warmer, std = _arrays(lives, longest)
    P = np.zeros((count, 2, 4, 4))
    shares = SHARES_BY["estimate"]
    for c, name in enumerate(CHANNELS):
        sizes = (GROWTH[name].start, GROWTH[name].rate / LIFE["strokes"],
                 shares[name].common * std[c], shares[name].by_temperature * std[c])  # fmt: skip
        P[:, c] = np.diag(np.square(sizes))
    x, used, deviance = np.zeros((count, 2, 4)), np.zeros(count), np.zeros(count)
    own = np.array([shares[name].independent for name in CHANNELS]) * std
    jumps = np.array([GROWTH[name].jump for name in CHANNELS])
    M, back = np.zeros((longest, count)), np.zeros((longest, count), int)
    recent: list[FloatArray] = []
    skipped = np.zeros(count, int)
    for t in range(longest):
        ds = s[t] - s[t - 1] if t else np.zeros(count)
        x[:, :, 0] += ds[:, None] * x[:, :, 1]
        F = np.tile(np.eye(4), (count, 1, 1))
        F[:, 0, 1] = ds
        for c, name in enumerate(CHANNELS):
            P[:, c] = F @ P[:, c] @ F.transpose(0, 2, 1)
            P[:, c, :2, :2] += np.array([growth_noise(name, LIFE["strokes"], float(d)) for d in ds])
        H = np.stack([np.ones(count), np.zeros(count), np.ones(count), warmer[t]], axis=1)
        scale = (WORTH + deviance) / (WORTH + 2 * used)
        PH = np.einsum("kcij,kj->kci", P, H)
        S = np.einsum("kci,ki->kc", PH, H) + scale[:, None] * own**2
        e = (values[t] - np.einsum("kci,ki->kc", x, H)) / np.sqrt(S)
        has = np.isfinite(e).all(axis=1)
        e = np.where(has[:, None], e, 0.0)
        square = (e**2).sum(axis=1)
        null = np.logaddexp(np.log1p(-outlier) - square / 2, np.log(outlier) - square / 2 / WIDE**2 - 2 * np.log(WIDE))
        recent = [*recent, np.stack([e[:, 0], e[:, 1], square, null, has], axis=1)][-SPAN:]
        M[t], back[t] = _ratio(recent)
        M[t] *= has
        keep = has & (used == 0) | has & (square < 13.8)  # exceeded by one in 1,000
        gain = PH / S[..., None] * keep[:, None, None]
        x += gain * (e * np.sqrt(S))[..., None]
        P -= np.einsum("kci,kcj->kcij", gain, PH)
        deviance, used = deviance + square * keep * (used > 0), used + keep
        skipped = np.where(keep, 0, skipped + has)
        change = skipped >= SPAN
        P[change, :, 0, 0] += jumps**2
        for array in recent:
            array[change] = 0.0
        skipped[change] = 0
    return M, back


def _arrays(lives: Sequence[DrawnLife], longest: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Places, values, air above the reference in 10 K, and standard deviations by channel; NaN where missing."""
    s, values = np.zeros((longest, len(lives))), np.full((longest, len(lives), 2), np.nan)
    warmer, std = np.zeros((longest, len(lives))), np.zeros(2)
    for i, vehicle in enumerate(lives):
        s[:, i] = np.pad(vehicle.s, (0, longest - len(vehicle.s)), mode="edge")
        for t, now in enumerate(vehicle.measurements):
            if now is not None:
                values[t, i], warmer[t, i] = (now.shift, now.load), (now.temperature - REFERENCE) / 10.0
                std = np.array([now.shift_std, now.load_std])
    return s, values, warmer, std


def _ratio(recent: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """M over the starts among the last readings, and how many readings ago the start with most of it was."""
    ratios = []
    for first in range(len(recent)):
        rows = np.stack(recent[first:])
        n = rows[:, :, 4].sum(axis=0)
        total, square, null = rows[:, :, :2].sum(axis=0), rows[:, :, 2].sum(axis=0), rows[:, :, 3].sum(axis=0)
        spread = 1.0 + n * TAU**2
        log_q = -0.5 * (square - TAU**2 / spread * (total**2).sum(axis=1)) - np.log(spread)
        ratios.append(np.where(recent[first][:, 4] > 0, np.exp(np.minimum(log_q - null, 600.0)), 0.0))
    table = np.stack(ratios)
    return table.sum(axis=0), len(recent) - 1 - table.argmax(axis=0)


def e_lists(lives: Sequence[DrawnLife], outlier: float, prior: float) -> list[ListedAlarm]:
    """Alarms in the list of e-BH of any week, each once."""
    M, back = detected(lives, outlier)
    alarms: dict[tuple[int, int], ListedAlarm] = {}
    for t in range(len(M)):
        order = np.argsort(-M[t])
        reached = np.flatnonzero(M[t][order] >= len(lives) / (SHARE * np.arange(1, len(lives) + 1)))
        for i in order[: reached[-1] + 1] if reached.size else ():
            k = t - int(back[t, i])
            if not any((i, j) in alarms for j in range(k - SPAN, k + SPAN + 1)):
                alarms[int(i), k] = ListedAlarm(int(i), k, 1.0 / (1.0 + prior * float(M[t, i])), t)
    return list(alarms.values())


def is_of(alarm: ListedAlarm, event: int) -> bool:
    """Whether an alarm is that of an event."""
    return abs(alarm.recording - event) <= 1


class Score(NamedTuple):
    """Shares of events found, and by one reading later, by size; length of a list, false and expected false ones."""

    shares: dict[float, float]
    later: dict[float, float]
    length: int
    false: int
    expected: float


def score(lives: Sequence[DrawnLife], alarms: Sequence[ListedAlarm], early: Sequence[ListedAlarm]) -> Score:
    """A list against the events; those at the last recording do not count, and alarms at them are not false."""
    by_vehicle: dict[int, list[ListedAlarm]] = {}
    by_early: dict[int, list[ListedAlarm]] = {}
    for rows, table in ((alarms, by_vehicle), (early, by_early)):
        for alarm in rows:
            table.setdefault(alarm.vehicle, []).append(alarm)
    hits_now: dict[float, list[bool]] = {size: [] for size in (0.0, *SIZES)}
    later: dict[float, list[bool]] = {size: [] for size in (0.0, *SIZES)}
    for i, vehicle in enumerate(lives):
        for k, size in vehicle.events.items():
            if k < len(vehicle.s) - 1:
                hits_now[size].append(any(is_of(alarm, k) for alarm in by_vehicle.get(i, ())))
                later[size].append(any(is_of(alarm, k) and alarm.listed <= k + 1 for alarm in by_early.get(i, ())))
    false = sum(not any(is_of(alarm, k) for k in lives[alarm.vehicle].events) for alarm in alarms)
    shares = [{size: 100.0 * float(np.mean(hits)) for size, hits in table.items()} for table in (hits_now, later)]
    return Score(*shares, len(alarms), false, sum(alarm.false for alarm in alarms))


def largest(alarms: Sequence[ListedAlarm], share: float) -> list[ListedAlarm]:
    """The largest list, best first, whose expected share of false ones is at most `share`."""
    ordered = sorted(alarms, key=lambda alarm: alarm.false)
    mean = np.cumsum([alarm.false for alarm in ordered]) / np.arange(1, len(ordered) + 1)
    return ordered[: int(np.sum(mean <= share))]


def fleet_of(options: argparse.Namespace, odd: float) -> list[DrawnLife]:
    """The vehicles, with a share of outliers."""
    tables = {n: table_of(options.family, n) for n in range(options.first, options.first + options.types)}
    random = np.random.default_rng(options.seed)
    fleet = visits(
        options.vehicles, options.months, options.family, options.first, options.types, options.seed, options.days
    )
    return [life(service, truth(service, tables[service[0].number], 0.0, random), odd, random) for service in fleet]


#: Shares of outliers that are estimated one from the other until two agree within a tenth, at most.
_ROUNDS = 5


def report(lives: Sequence[DrawnLife], *, estimated: bool) -> None:
    """Print a row for each list."""
    before = trend._OCCURRENCE
    outlier = before.outlier
    for _ in range(_ROUNDS):
        trend._OCCURRENCE = before._replace(outlier=outlier)
        results = [posteriors(i, vehicle) for i, vehicle in enumerate(lives)]
        outliers, measured = np.sum([counts for _, counts in results], axis=0)
        share = (outliers + 0.5) / (measured + 50.0)
        if not estimated or abs(share - outlier) <= 0.1 * outlier:
            break
        outlier = share
    everything = [alarm for alarms, _ in results for alarm in alarms]
    early = [
        (alarm, k + 1)
        for i, vehicle in enumerate(lives) for k in vehicle.events if 0 < k < len(vehicle.s) - 1
        for alarm in posteriors(i, vehicle, k + 2)[0]
    ]  # fmt: skip
    trend._OCCURRENCE = before
    before_lists = [alarm for alarm in everything if alarm.listed < 0]
    listed = largest([alarm for alarm in everything if alarm.listed >= 0 and alarm.false <= 1.0 - POSSIBLE], SHARE)
    by_e_values = e_lists(lives, outlier, _prior(lives))
    rows = {
        "posterior": score(lives, before_lists, [alarm._replace(listed=k) for alarm, k in early if alarm.listed < 0]),
        "list": score(lives, listed, [
            alarm._replace(listed=k) for alarm, k in early if alarm.listed >= 0 and alarm.false <= 1.0 - POSSIBLE
        ]),
        "e-BH": score(lives, by_e_values, by_e_values),
    }  # fmt: skip
    print(f"  share of outliers {outlier:.4f}")
    for name, row in rows.items():
        shares = "  ".join(f"{row.shares[size]:5.1f} ({row.later[size]:5.1f})" for size in row.shares)
        print(f"  {name:9}: {shares};  list {row.length}, false {row.false}, expected {row.expected:.1f}")


def _prior(lives: Sequence[DrawnLife]) -> float:
    """Changes a recording, as `wear/trend.py` assumes them."""
    strokes = np.mean([np.mean(np.diff(vehicle.s)) for vehicle in lives])
    return float((trend._OCCURRENCE.replaced + trend._OCCURRENCE.sudden) * strokes / LIFE["strokes"])


def main() -> None:
    """Print the lists by share of outliers: found (by one reading later) of replaced clutches and of jumps."""
    parser = fleet_parser(__doc__, seed=77, months=12.0)
    parser.add_argument("--shares", type=float, nargs="+", default=[0.002, 0.01, 0.02])
    parser.add_argument("--estimated", action="store_true")
    options = parser.parse_args()
    for odd in options.shares:
        lives = fleet_of(options, odd)
        sizes = [size for vehicle in lives for k, size in vehicle.events.items() if k < len(vehicle.s) - 1]
        counts = ", ".join(
            f"{sizes.count(size)} of {size:g}" if size else f"{sizes.count(0)} replaced" for size in (0.0, *SIZES)
        )
        recordings = sum(len(vehicle.s) for vehicle in lives)
        print(f"{options.family}, {recordings} recordings, {100 * odd:g} % outliers; {counts}")
        report(lives, estimated=options.estimated)


if __name__ == "__main__":
    main()
