"""Excitation that a recording lacks to identify load and parameters."""

from __future__ import annotations

import numpy as np

from clutchid.inference.uncertainty.gaussian import Information
from clutchid.inference.uncertainty.identifiability import CORRELATION, correlations, identifiable, in_words
from clutchid.model.actuator import Actuator
from clutchid.strokes.excitation import SHORTEST_REST, VENTED_POSITION, Excitation
from clutchid.strokes.stroke import FULL
from clutchid.strokes.vented_pressure import RECORD_REST, UNSETTLED

#: A load weight acts where its basis function has more than this fraction of its largest value.
_ACTS = 0.01

#: Largest number of correlated pairs that are reported.
_MOST_PAIRS = 3


def missing_excitation(excitation: Excitation, actuator: Actuator, information: Information | None = None) -> list[str]:
    """Excitation that a recording lacks to identify load and parameters, a sentence each; empty if none is missing.

    Parameters
    ----------
    excitation : Excitation
        Excitation of one recording, or of several together.
    actuator : Actuator
        The fitted actuator: its stroke, its valves and the basis of its load.
    information : Information, optional
        About the free parameters and load weights. Without it, only the motion is evaluated.

    Returns
    -------
    sentences : list of str

    Examples
    --------
    >>> from clutchid.strokes.excitation import excitation
    >>> from clutchid.log import Log
    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> y = np.interp(t, [0.0, 1.0, 2.0], [0.004, 0.008, 0.004])
    >>> missing_excitation(excitation(Log(t, {"position": y})), Actuator())[0]
    'this log reaches 8.0 mm of 25.0 mm and contains no information about the load beyond: reach 20.0 mm or more.'
    """
    who = "this log" if excitation.recordings == 1 else f"these {excitation.recordings} logs"
    verb = ("reaches", "passes", "contains") if excitation.recordings == 1 else ("reach", "pass", "contain")
    reaching = f"{who} {verb[0]} {excitation.reach * 1e3:.1f} mm"
    sentences: list[str] = []
    if information is not None:
        sentences += _weights_beyond_reach(information, actuator, excitation, reaching)
        sentences += _correlated_weights(information, actuator, excitation, reaching)
        sentences += _other_parameters(information, actuator, excitation, who)
    y_max = actuator.parameters.y_max
    if excitation.reach < FULL * y_max and not any(reaching in sentence for sentence in sentences):
        sentences.append(
            f"{reaching} of {y_max * 1e3:.1f} mm and {verb[2]} no information about the load beyond: "
            f"reach {FULL * y_max * 1e3:.1f} mm or more."
        )
    return sentences + _one_way(excitation, f"{who} {verb[1]}") + _never_vents(excitation, who)


def _weights_beyond_reach(
    information: Information, actuator: Actuator, excitation: Excitation, reaching: str
) -> list[str]:
    """Load weights that are not identifiable because they act beyond the reach."""
    unknown = [name for name in _not_identifiable(information) if name in actuator.load.names]
    spans = {name: _span(name, actuator) for name in unknown}
    beyond = {name: span for name, span in spans.items() if span[1] > excitation.reach}
    if not beyond:
        return []
    begin, needed = min(span[0] for span in beyond.values()), max(span[1] for span in beyond.values())
    contains, act = "contains" if excitation.recordings == 1 else "contain", "acts" if len(beyond) == 1 else "act"
    return [
        f"{reaching} and {contains} no information about {in_words(list(beyond))}, which {act} from {begin * 1e3:.1f} "
        f"mm on: reach {needed * 1e3:.1f} mm or more."
    ]


def _not_identifiable(information: Information) -> list[str]:
    determined = identifiable(information.R)
    return [name for name, is_known in zip(information.names, determined, strict=True) if not is_known]


def _span(name: str, actuator: Actuator) -> tuple[float, float]:
    """Position at which a load weight begins to act, and that of its maximum, at most the last knot, in m."""
    load = actuator.load
    y = np.linspace(0.0, actuator.parameters.y_max, 501)
    phi = np.abs(load.phi(y)[:, load.names.index(name)])
    top = int(np.argmax(phi))
    return float(y[np.argmax(phi > _ACTS * phi[top])]), min(float(y[top]), load.knots[-1])


def _correlated_weights(
    information: Information, actuator: Actuator, excitation: Excitation, reaching: str
) -> list[str]:
    """Pairs of load weights that correlate because the reach ends before the maximum of the further one."""
    determined = [name for name in information.names if name not in _not_identifiable(information)]
    if len(determined) < 2:
        return []
    matrix = correlations(information.columns(determined))
    weights = [(k, name) for k, name in enumerate(determined) if name in actuator.load.names]
    pairs = [
        (float(matrix[k, j]), weight, other)
        for n, (j, weight) in enumerate(weights)
        for k, other in weights[n + 1 :]
        if abs(matrix[k, j]) > CORRELATION
    ]
    sentences = []
    for correlation, weight, other in sorted(pairs, key=lambda pair: -abs(pair[0])):
        needed = max(_span(weight, actuator)[1], _span(other, actuator)[1])
        if excitation.reach < needed:
            sentences.append(
                f"{reaching}; the correlation of {weight} and {other} is {correlation:+.2f}: reach "
                f"{needed * 1e3:.1f} mm or more."
            )
    return sentences[:_MOST_PAIRS]


def _other_parameters(information: Information, actuator: Actuator, excitation: Excitation, who: str) -> list[str]:
    """Parameters that are not identifiable for a reason that the motion shows."""
    p = actuator.parameters
    unknown = _not_identifiable(information)
    contains = "contains" if excitation.recordings == 1 else "contain"
    reasons = (
        ("full supply", excitation.highest_supply < p.R_1vs, _stays("duty_supply", excitation.highest_supply, p.R_1vs)),
        (
            "full exhaust",
            excitation.highest_exhaust < p.R_1ve,
            _stays("duty_exhaust", excitation.highest_exhaust, p.R_1ve),
        ),
        (
            "far stop",
            excitation.reach < p.y_max,
            f"the piston reaches {excitation.reach * 1e3:.1f} mm, {(p.y_max - excitation.reach) * 1e3:.1f} mm short "
            "of its stroke; move it closer to the end stop.",
        ),
    )
    sentences = []
    rows = actuator.rows
    for need, holds, why in reasons:
        members = [name for name in unknown if name in rows and rows[name].needs == need]
        if members and holds:
            sentences.append(f"{who} {contains} no information about {in_words(members)}: {why}")
    return sentences


def _stays(duty: str, highest: float, full: float) -> str:
    return f"{duty} never exceeds {highest:.2f}, but the valve is fully open from {full:.2f} on; open it further."


def _one_way(excitation: Excitation, passing: str) -> list[str]:
    """Regions passed in one direction only, where friction and load cannot be separated."""
    sentences = []
    for visit in excitation.regions:
        ways = (("opening", visit.opening, "closing"), ("closing", visit.closing, "opening"))
        times = [(way, number, other) for way, number, other in ways if number]
        if len(times) == 1:
            way, number, other = times[0]
            low, high = visit.low * 1e3, visit.high * 1e3
            ends = f"from {low:.0f} mm on" if np.isinf(high) else f"{low:.0f} to {high:.0f} mm"
            sentences.append(
                f"{passing} {ends} {number} {'time' if number == 1 else 'times'}, only while {way}: friction and "
                f"load cannot be separated there; pass it while {other}, too."
            )
    return sentences


def _never_vents(excitation: Excitation, who: str) -> list[str]:
    if excitation.vented_rests:
        return [f"{who}: {UNSETTLED}; {RECORD_REST}."] if excitation.unsettled == excitation.recordings else []
    rest = (
        f"vented rest (lowest position {excitation.lowest * 1e3:.1f} mm)"
        if excitation.lowest > VENTED_POSITION
        else f"vented rest of {SHORTEST_REST:g} s or more at the engaged end"
    )
    return [
        f"{who} {'has' if excitation.recordings == 1 else 'have'} no {rest}, so the pressure is unknown without a "
        "sensor; add a rest of one second with the clutch engaged."
    ]
