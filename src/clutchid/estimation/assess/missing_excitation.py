"""Excitation that a recording lacks, from its motion and from the Jacobian of a fit; sentences for the user."""

from __future__ import annotations

import numpy as np

from clutchid.inference.uncertainty.identifiability import CORRELATION, correlations, identifiable, listed
from clutchid.inference.uncertainty.information import Information
from clutchid.model.actuator import Actuator
from clutchid.recordings.signals.excitation import SHORTEST_REST, STROKE, VENTED_POSITION, Excitation

#: A load weight acts where its basis function has more than this fraction of its largest value.
ACTS = 0.01

#: Largest number of correlated pairs that are reported.
MOST_PAIRS = 3


def missing(found: Excitation, actuator: Actuator, information: Information | None = None) -> list[str]:
    """What a recording lacks to identify load and parameters, one sentence each; empty if nothing is missing.

    Parameters
    ----------
    found : Excitation
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
    >>> from clutchid.recordings.signals.excitation import excitation
    >>> from clutchid.log import Log
    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> y = np.interp(t, [0.0, 1.0, 2.0], [0.004, 0.008, 0.004])
    >>> missing(excitation(Log(t, {"position": y})), Actuator())[0]
    'this log reaches 8.0 mm of 25.0 mm and contains no information about the load beyond: reach 20.0 mm or more.'
    """
    who = "this log" if found.recordings == 1 else f"these {found.recordings} logs"
    verb = ("reaches", "passes", "contains") if found.recordings == 1 else ("reach", "pass", "contain")
    reaching = f"{who} {verb[0]} {found.reach * 1e3:.1f} mm"
    sentences: list[str] = []
    if information is not None:
        sentences += _weights_beyond_reach(information, actuator, found, reaching)
        sentences += _correlated_weights(information, actuator, found, reaching)
        sentences += _other_parameters(information, actuator, found, who)
    y_max = actuator.parameters.y_max
    if found.reach < STROKE[1] * y_max and not any(reaching in sentence for sentence in sentences):
        sentences.append(
            f"{reaching} of {y_max * 1e3:.1f} mm and {verb[2]} no information about the load beyond: "
            f"reach {STROKE[1] * y_max * 1e3:.1f} mm or more."
        )
    return sentences + _one_way(found, f"{who} {verb[1]}") + _never_vents(found, who)


def _weights_beyond_reach(information: Information, actuator: Actuator, found: Excitation, reaching: str) -> list[str]:
    """Load weights that are not identifiable because they act beyond the reach."""
    unknown = [name for name in _not_identifiable(information) if name in actuator.load.names]
    spans = {name: _span(name, actuator) for name in unknown}
    beyond = {name: span for name, span in spans.items() if span[1] > found.reach}
    if not beyond:
        return []
    begin, needed = min(span[0] for span in beyond.values()), max(span[1] for span in beyond.values())
    contains, act = "contains" if found.recordings == 1 else "contain", "acts" if len(beyond) == 1 else "act"
    return [
        f"{reaching} and {contains} no information about {listed(list(beyond))}, which {act} from {begin * 1e3:.1f} mm "
        f"on: reach {needed * 1e3:.1f} mm or more."
    ]


def _not_identifiable(information: Information) -> list[str]:
    known = identifiable(information.R)
    return [name for name, is_known in zip(information.names, known, strict=True) if not is_known]


def _span(name: str, actuator: Actuator) -> tuple[float, float]:
    """Position at which a load weight begins to act, and that of its maximum, at most the last knot, in m."""
    load = actuator.load
    y = np.linspace(0.0, actuator.parameters.y_max, 501)
    phi = np.abs(load.phi(y)[:, load.names.index(name)])
    top = int(np.argmax(phi))
    return float(y[np.argmax(phi > ACTS * phi[top])]), min(float(y[top]), load.knots[-1])


def _correlated_weights(information: Information, actuator: Actuator, found: Excitation, reaching: str) -> list[str]:
    """Pairs of load weights that correlate because the reach ends before the maximum of the further one."""
    known = [name for name in information.names if name not in _not_identifiable(information)]
    if len(known) < 2:
        return []
    matrix = correlations(information.columns(known))
    weights = [(k, name) for k, name in enumerate(known) if name in actuator.load.names]
    pairs = [
        (float(matrix[k, j]), one, other)
        for n, (j, one) in enumerate(weights)
        for k, other in weights[n + 1 :]
        if abs(matrix[k, j]) > CORRELATION
    ]
    sentences = []
    for correlation, one, other in sorted(pairs, key=lambda pair: -abs(pair[0])):
        needed = max(_span(one, actuator)[1], _span(other, actuator)[1])
        if found.reach < needed:
            sentences.append(
                f"{reaching}; the correlation of {one} and {other} is {correlation:+.2f}: reach {needed * 1e3:.1f} mm "
                "or more."
            )
    return sentences[:MOST_PAIRS]


def _other_parameters(information: Information, actuator: Actuator, found: Excitation, who: str) -> list[str]:
    """Parameters that are not identifiable for a reason that the motion shows."""
    p = actuator.parameters
    unknown = _not_identifiable(information)
    contains = "contains" if found.recordings == 1 else "contain"
    reasons = (
        ("full supply", found.highest_supply < p.R_1vs, _stays("duty_supply", found.highest_supply, p.R_1vs)),
        ("full exhaust", found.highest_exhaust < p.R_1ve, _stays("duty_exhaust", found.highest_exhaust, p.R_1ve)),
        (
            "far stop",
            found.reach < p.y_max,
            f"the piston reaches {found.reach * 1e3:.1f} mm, {(p.y_max - found.reach) * 1e3:.1f} mm short of its "
            "stroke; move it closer to the end stop.",
        ),
    )
    sentences = []
    rows = actuator.rows
    for need, holds, why in reasons:
        members = [name for name in unknown if name in rows and rows[name].needs == need]
        if members and holds:
            sentences.append(f"{who} {contains} no information about {listed(members)}: {why}")
    return sentences


def _stays(duty: str, highest: float, full: float) -> str:
    return f"{duty} never exceeds {highest:.2f}, but the valve is fully open from {full:.2f} on; open it further."


def _one_way(found: Excitation, passing: str) -> list[str]:
    """Regions passed in one direction only, where friction and load cannot be separated."""
    sentences = []
    for visit in found.regions:
        ways = (("opening", visit.opening, "closing"), ("closing", visit.closing, "opening"))
        times = [(way, number, other) for way, number, other in ways if number]
        if len(times) == 1:
            way, number, other = times[0]
            ends = f"from {visit.low * 1e3:.0f} mm on" if np.isinf(visit.high) else _between(visit.low, visit.high)
            sentences.append(
                f"{passing} {ends} {number} {'time' if number == 1 else 'times'}, only while {way}: friction and "
                f"load cannot be separated there; pass it while {other}, too."
            )
    return sentences


def _between(low: float, high: float) -> str:
    return f"{low * 1e3:.0f} to {high * 1e3:.0f} mm"


def _never_vents(found: Excitation, who: str) -> list[str]:
    if found.vented_rests:
        return []
    rest = (
        f"vented rest (lowest position {found.lowest * 1e3:.1f} mm)"
        if found.lowest > VENTED_POSITION
        else f"vented rest of {SHORTEST_REST:g} s or more at the engaged end"
    )
    return [
        f"{who} {'has' if found.recordings == 1 else 'have'} no {rest}, so the pressure is unknown without a sensor; "
        "add a rest of one second with the clutch engaged."
    ]
