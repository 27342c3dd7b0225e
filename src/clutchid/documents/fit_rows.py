"""Rows of a fit: verdict, load, changes, what is assumed, errors; in brief and in full."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.changes import assumed_sentences, change_sentences, notes_of, rest_words, short_changes
from clutchid.documents.document import LabelRow, On, labelled
from clutchid.documents.style import MM
from clutchid.estimation import Fit
from clutchid.estimation.assess.comparison import Comparison, HalfLoad, comparison, half_load_band
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.rest import moved_rests
from clutchid.estimation.assess.verdict import of_the_paper, states_of_wear, verdict
from clutchid.inference.uncertainty.calibration import Calibration

if TYPE_CHECKING:
    from clutchid.estimation import Errors


def errors_text(errors: Errors) -> str:
    """Errors of a simulation for a terminal.

    Examples
    --------
    >>> from clutchid.estimation import Errors
    >>> errors_text(Errors(2.5e-4, 1e-6, None, None)), errors_text(Errors(2.5e-4, 1e-6, 7100.0, 1e9))
    ('position 0.250 mm rms', 'position 0.250 mm rms, pressure 7.1 kPa rms')
    """
    pressure = "" if errors.pressure_a_rms is None else f", pressure {errors.pressure_a_rms / 1e3:.1f} kPa rms"
    return f"position {errors.position_rms * 1e3:.3f} mm rms{pressure}"


def errors_words(fit: Fit) -> str:
    """Kind of the errors of a fit, to follow them: simulated as a whole, in windows, or one sample ahead."""
    words = {"shooting": " over windows of 0.1 s", "prediction-error": ", predicted one sample ahead"}
    return words.get(fit.method, ", simulated")


#: Positions in mm at which the load is given: where the clutch engages.
POSITIONS = (5, 6, 7, 8)

#: Most reasons, other parameters, and verified recordings in a summary; the rest is said to be elsewhere.
_MOST_REASONS, _MOST_OTHERS, _MOST_VERIFIED = 2, 4, 2

#: Half width in N from which an interval is not shown, and what stands there.
LARGEST_HALF, _NOT_DETERMINED = 1e5, "not determined"


def rows_of(fit: Fit) -> list[LabelRow]:
    """Rows of a fit, and of its recordings read one by one."""
    compared = comparison(fit)
    rows = [*_trust(fit), *_load(fit, compared), *_since(fit, compared), *labelled("alone", _readings(fit.readings))]
    rows += [*_others(fit), LabelRow("errors", _errors(fit), on=On.BRIEF | On.PAGE)]
    return [*rows, LabelRow("search", _search(fit), on=On.PAGE), *_in_full(fit)]


def _trust(fit: Fit) -> list[LabelRow]:
    judged = verdict(fit)
    more = len(judged.reasons) - _MOST_REASONS
    rows = [LabelRow("trust", judged.trust, judged.trust), LabelRow("", judged.meaning, on=On.PAGE)]
    rows += [
        LabelRow("", text, on=On.ALL if i < _MOST_REASONS else On.FULL | On.PAGE)
        for i, text in enumerate(judged.reasons)
    ]
    rows += [LabelRow("", f"{more} more reason{'s' if more > 1 else ''}: --verbose", on=On.BRIEF)] if more > 0 else []
    rows += [LabelRow("", judged.experience)] if judged.experience else []
    return rows


def _search(fit: Fit) -> str:
    """End of the search, for a page."""
    if fit.status == "failed":
        return f"the fit failed, and there is no load to show: {fit.message.rstrip('.')}"
    return f"{fit.message.rstrip('.')}{'' if fit.warnings else ', without warnings'}"


def _in_full(fit: Fit) -> list[LabelRow]:
    """Details that a summary leaves out: end of the search, all parameters, errors of all recordings, and notes."""
    width = max([9, *(len(name) for name in fit.parameters)])
    lines = ["", f"{'parameter':<{width}}  {'value':>12}  {'std. error':>10}  {'95 % interval':>27}  unit"]
    for name, e in fit.parameters.items():
        lines.append(f"{name:<{width}}  {e.value:12.5g}  {e.std:10.2g}  {e.low:12.5g} .. {e.high:12.5g}  {e.unit}")
    sentences, fitted = [f"The search {fit.message}.", *_starts(fit)], errors_words(fit)
    for title, recordings in (("fitted", fit.recordings), ("verified", fit.verification)):
        for name, recording in recordings.items():
            how = ", simulated from its duty cycles" if title == "verified" else fitted
            sentences.append(f"{title} {name}: {errors_text(recording.errors)}{how}")
    table = LabelRow(None, "\n".join(lines), fixed=True, on=On.FULL)
    return [table, *(LabelRow(None, text, on=On.FULL) for text in [*sentences, *notes_of(fit)])]


def _starts(fit: Fit) -> list[str]:
    """Final cost of every start, as a sentence; none for a single one."""
    if len(fit.starts) < 2:
        return []
    ends = (f"{start.name} {start.cost:.4g} ({start.status})" for start in fit.starts)
    return [f"Cost of {len(fit.starts)} starts: {', '.join(ends)}."]


def other_warnings(fit: Fit) -> list[str]:
    """Warnings besides those that the verdict has as a reason: estimates at bounds, and the end of the search."""
    said = tuple(f"{name} lies at its " for name in fit.parameters)
    return [text for text in fit.warnings if not text.startswith((*said, f"the search {fit.message}"))]


def _load(fit: Fit, compared: Comparison | None) -> list[LabelRow]:
    curve, furthest = fit.load_curve, reach(fit)
    if not np.isfinite(curve.force).any():
        return []
    at = curve.peak(furthest)
    text = f"greatest {_force(fit, at)} at {curve.position[at] / MM:.1f} mm"
    text += f" of the recorded {furthest / MM:.1f} mm"
    text += _half(half_load_band(curve, furthest), fit.load_is_fitted)
    text += "" if fit.load_is_fitted else "; fixed, not fitted"
    return [LabelRow("load", text), _at_positions(fit, compared, furthest)]


def _force(fit: Fit, at: int) -> str:
    """The load at one of its points; without an interval, the value alone."""
    curve = fit.load_curve
    shown = with_interval(curve.force[at], (curve.high[at] - curve.low[at]) / 2)
    if shown != _NOT_DETERMINED and fit.load_is_fitted:
        return f"{shown} N"
    return f"{curve.force[at]:.0f} N{' (interval not determined)' if fit.load_is_fitted else ''}"


def _half(at: HalfLoad, fitted: bool) -> str:
    if not isfinite(at.position):
        return ""
    return f"; half of it at {at.position / MM:.2f} mm{interval_words(at) if fitted else ''}"


def interval_words(at: HalfLoad, sign: str = "", behind: str = "") -> str:
    """Interval of a half-load position or of its shift in mm, in brackets, with some words; nothing if infinite."""
    finite = isfinite(at.low + at.high)
    return f" ({at.low / MM:{sign}z.2f} to {at.high / MM:{sign}z.2f}{behind})" if finite else ""


def _at_positions(fit: Fit, compared: Comparison | None, furthest: float) -> LabelRow:
    """The load, and its change, at the positions where the clutch engages, as a table."""
    curve = fit.load_curve
    force, low, high = (
        [float(np.interp(mm * MM, curve.position, values)) for mm in POSITIONS]
        for values in (curve.force, curve.low, curve.high)
    )
    lines = [["", *(f"{mm} mm" for mm in POSITIONS)]]
    loads = (with_interval(f, (b - a) / 2) for f, a, b in zip(force, low, high, strict=True))
    lines.append(["N", *(loads if fit.load_is_fitted else (f"{f:.0f}" for f in force))])
    if compared:
        changes = [compared.at(mm * MM) for mm in POSITIONS]
        lines.append(["change", *(with_interval(c.force, (c.high - c.low) / 2, sign="+") for c in changes)])
        lines.append(["", *(f"{100 * c.share:+z.0f} %" if isfinite(c.share) else "" for c in changes)])
    lines = [[line[0], *_within(line[1:], furthest)] for line in lines]
    text = ("".join([line[0].ljust(7), *(cell.rjust(15) for cell in line[1:])]).rstrip() for line in lines)
    return LabelRow("", "\n".join(text), fixed=True, cells=tuple(map(tuple, lines)))


def _within(cells: list[str], furthest: float) -> list[str]:
    """A dash beyond the reach of the recordings, where no load is determined; headings stay."""
    if cells[0].endswith(" mm"):
        return cells
    return [cell if mm * MM <= furthest else "-" for mm, cell in zip(POSITIONS, cells, strict=True)]


def with_interval(value: float, half: float, sign: str = "") -> str:
    """A value with the half width of its interval, both in N; an interval of 100 kN says nothing.

    Examples
    --------
    >>> with_interval(1520.3, 41.8), with_interval(-110.0, 50.0, "+"), with_interval(1520.3, float("inf"))
    ('1520 ± 42', '-110 ± 50', 'not determined')
    """
    return f"{value:{sign}z.0f} ± {half:.0f}" if isfinite(value) and half < LARGEST_HALF else _NOT_DETERMINED


def _since(fit: Fit, compared: Comparison | None) -> list[LabelRow]:
    """Changes since the calibration, or the values that are assumed without one."""
    if fit.baseline is None:
        if fit.calibration is None and of_the_paper(fit):
            return [LabelRow("assumed", "parameters not fitted are those of the paper's truck: no calibration")]
        return []
    name, on_pages = baseline_name(fit.baseline), On.BRIEF | On.PAGE
    if states_of_wear(fit) is not None:
        since = LabelRow("since", f"{name}: see each recording on its own")
        rows = [since, *(LabelRow("", sentence, on=On.PAGE) for sentence in change_sentences(fit))]
        return [*rows, *labelled("assumed", assumed_sentences(fit), On.PAGE)]
    parts = []
    if compared and isfinite(compared.shift.position):
        at = compared.shift
        parts.append(f"half-load position {at.position / MM:+z.2f} mm{interval_words(at, '+')}")
    if compared is None and fit.load_is_fitted:
        parts.append("the file has no load, so the loads cannot be compared; save the calibration again")
    rests = [rest_words(rest) if len(fit.recordings) == 1 else f"{rest.recording}: {rest_words(rest)}"
             for rest in moved_rests(fit)]  # fmt: skip
    changes = short_changes(fit.changes) or [f"no {'other ' if fit.load_is_fitted else ''}change found"]
    in_full = parts if fit.changes else [*parts, *changes]
    rows = [LabelRow("since", f"{name}: {'; '.join([*parts, *rests, *changes])}", on=on_pages)]
    rows += [LabelRow("since", f"{name}: {'; '.join(in_full)}", on=On.FULL)] if in_full else []
    return [*rows, *labelled("assumed", assumed_sentences(fit), on_pages)]


def baseline_name(baseline: Calibration) -> str:
    """A calibration as its file, date and trust.

    Examples
    --------
    >>> from clutchid.inference.uncertainty.calibration import Origin
    >>> origin = Origin("CAL.toml", "2026-11-22T10:00:00+00:00", "", "good")
    >>> baseline_name(Calibration((), np.zeros((0, 0)), origin=origin))
    'CAL.toml (2026-11-22, trust good)'
    """
    origin = baseline.origin
    if origin is None or not origin.name:
        return "the calibration"
    facts = [origin.created[:10], f"trust {origin.trust}" if origin.trust else ""]
    brackets = ", ".join(part for part in facts if part)
    return f"{origin.name} ({brackets})" if brackets else origin.name


def _readings(single: Mapping[str, Fit]) -> list[str]:
    """A line for each recording read alone: its change at 6 mm, shift, and trust."""
    lines = []
    for name, fit in single.items():
        compared = comparison(fit)
        if compared is not None:
            text = _change_at(compared, 6)
            text += f", half-load {compared.shift.position / MM:+z.2f} mm" if isfinite(compared.shift.position) else ""
            lines.append(f"{name}: {text}, trust {verdict(fit).trust}")
    return lines


def _change_at(compared: Comparison, mm: int) -> str:
    """The change of the load at a position in mm."""
    change = compared.at(mm * MM)
    if not (mm * MM <= compared.reach and isfinite(change.force)):
        return f"no load at {mm} mm"
    share = f" ({100 * change.share:+z.0f} %)" if isfinite(change.share) else ""
    return f"{change.force:+z.0f} N{share} at {mm} mm"


def _others(fit: Fit) -> list[LabelRow]:
    """Fitted parameters besides the load; many are only counted."""
    others = {name: e for name, e in fit.parameters.items() if name not in fit.actuator.load.names}
    own = {name: e for name, e in others.items() if "@" not in name}
    if not own:
        return []
    if len(own) > _MOST_OTHERS:
        return [
            LabelRow(
                "also", f"{len(own)} other parameters were fitted: --verbose, or the page of --report", on=On.BRIEF
            )
        ]
    return [LabelRow("also", ", ".join(f"{name} = {e}" for name, e in own.items()), on=On.BRIEF | On.PAGE)]


def _errors(fit: Fit) -> str:
    parts = [f"{errors_text(fit.errors)}{errors_words(fit)}"]
    for name, recording in islice(fit.verification.items(), _MOST_VERIFIED):
        parts.append(f"{name}, verified: {errors_text(recording.errors)}, simulated as a whole")
    more = len(fit.verification) - _MOST_VERIFIED
    return "; ".join([*parts, *([f"{more} more: --verbose"] if more > 0 else [])])
