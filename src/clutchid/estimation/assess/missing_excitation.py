"""Excitation that a recording lacks to identify the load."""

from __future__ import annotations

import numpy as np

from clutchid.model.actuator import Actuator
from clutchid.strokes.excitation import SHORTEST_REST, VENTED_POSITION, Excitation
from clutchid.strokes.stroke import FULL
from clutchid.strokes.vented_pressure import RECORD_REST, UNSETTLED


def missing_excitation(excitation: Excitation, actuator: Actuator) -> list[str]:
    """Excitation that a recording lacks to identify the load, a sentence each; empty if none is missing.

    Parameters
    ----------
    excitation : Excitation
        Excitation of one recording, or of several together.
    actuator : Actuator
        The fitted actuator: its stroke.

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
    sentences: list[str] = []
    y_max = actuator.parameters.y_max
    if excitation.reach < FULL * y_max:
        sentences.append(
            f"{who} {verb[0]} {excitation.reach * 1e3:.1f} mm of {y_max * 1e3:.1f} mm and {verb[2]} no information "
            f"about the load beyond: reach {FULL * y_max * 1e3:.1f} mm or more."
        )
    return sentences + _one_way(excitation, f"{who} {verb[1]}") + _never_vents(excitation, who)


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
