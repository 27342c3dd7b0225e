"""A fit as text for a terminal, in full."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clutchid.estimation import Fit
    from clutchid.estimation.result import Errors


def errors_text(errors: Errors) -> str:
    """Errors of a simulation for a terminal.

    Examples
    --------
    >>> from clutchid.estimation.result import Errors
    >>> errors_text(Errors(2.5e-4, 1e-6, None, None)), errors_text(Errors(2.5e-4, 1e-6, 7100.0, 1e9))
    ('position 0.250 mm rms', 'position 0.250 mm rms, pressure 7.1 kPa rms')
    """
    pressure = "" if errors.pressure_a_rms is None else f", pressure {errors.pressure_a_rms / 1e3:.1f} kPa rms"
    return f"position {errors.position_rms * 1e3:.3f} mm rms{pressure}"


def errors_words(fit: Fit) -> str:
    """What the errors of a fit are, to follow them: simulated as a whole, in windows, or one sample ahead."""
    words = {"shooting": " over windows of 0.1 s", "prediction-error": ", predicted one sample ahead"}
    return words.get(fit.method, ", simulated")


def fit_text(fit: Fit, columns: int = 80) -> str:
    """What a summary leaves out: how the search ended, all parameters, errors of all recordings, and notes.

    Sentences are wrapped at a width in columns.
    """
    from clutchid.reports.changes import notes_of

    width = max([9, *(len(name) for name in fit.parameters)])
    lines = [f"{'parameter':<{width}}  {'value':>12}  {'std. error':>10}  {'95 % interval':>27}  unit"]
    for name, e in fit.parameters.items():
        lines.append(f"{name:<{width}}  {e.value:12.5g}  {e.std:10.2g}  {e.low:12.5g} .. {e.high:12.5g}  {e.unit}")
    sentences, fitted = [f"The search {fit.message}."], errors_words(fit)
    for title, recordings in (("fitted", fit.recordings), ("verified", fit.verification)):
        for name, recording in recordings.items():
            how = ", simulated from its duty cycles" if title == "verified" else fitted
            sentences.append(f"{title} {name}: {errors_text(recording.errors)}{how}")
    wrapped = (fill(text, columns, subsequent_indent="  ") for text in [*sentences, *notes_of(fit)])
    return "\n".join([*lines, *wrapped])
