"""Methods of results that belong to higher packages: ``fit.plot()``, ``fit.verdict``, a picture in a notebook.

The classes of lower packages only declare it. Whoever takes a name from `clutchid` has it attached to them.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from clutchid.arguments import checked
from clutchid.log import INPUTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from clutchid.estimation.assess.comparison import Comparison
    from clutchid.estimation.assess.evidence import Evidence
    from clutchid.estimation.assess.verdict import Verdict
    from clutchid.estimation.fit_problem import FitProblem
    from clutchid.estimation.result import Fit
    from clutchid.log import Log
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.simulation.simulation import Simulation


@checked
def plot(shown: Log | Simulation | Fit) -> Figure:
    """Figure of a log, a simulation or a fit, as matplotlib has it without pyplot; as ``shown.plot()``.

    Parameters
    ----------
    shown : Log, Simulation or Fit
        A fit is drawn as its load over the position; the others as their columns over time.

    Returns
    -------
    figure : matplotlib Figure
        With units on its axes; ``figure.savefig(path)`` writes it.

    Raises
    ------
    SolveError
        If a fit failed: there is no load to draw.

    Examples
    --------
    The load in N with its band:

    >>> import clutchid
    >>> figure = clutchid.plot(clutchid.fit(clutchid.bundled_recording().slice(0, 4000)))
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['load [N]']
    """
    from clutchid.documents import document_of
    from clutchid.documents.notebook import notebook_figure

    figure = notebook_figure(document_of(shown.raised() if hasattr(shown, "raised") else shown))
    assert figure is not None
    return figure


@checked
def from_frame(
    frame: object, name: str = "frame", *, ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None, required: Sequence[str] = ("time", "position", *INPUTS),
) -> Log:  # fmt: skip
    """Make a recording of a data frame, read as a file with the same columns; as ``clutchid.Log.from_frame(frame)``.

    Parameters
    ----------
    frame : table of pandas, polars or Arrow, or a mapping
        Columns by headings as in files, such as ``time [s]``, ``position [mm]``, ``duty_supply [%]``; a time may be a
        date. An index of pandas is a column where it has a name.
    name
        Name of the recording.
    ambient, channels, required
        As in `clutchid.read`.

    Returns
    -------
    log : Log
        In SI.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.read`.

    Examples
    --------
    >>> import clutchid
    >>> columns = {"time [ms]": [0, 1], "position [mm]": [0.0, 0.5], "duty_supply [%]": [0, 100]}
    >>> clutchid.Log.from_frame({**columns, "duty_exhaust [1]": [False, False]})["duty_supply"].tolist()
    [0.0, 1.0]
    """
    from clutchid.measurements import read_frame

    return read_frame(frame, name, ambient, channels, required)


@checked
def report(fit: Fit, path: str | PathLike[str]) -> None:
    """Write the page that ``clutchid fit --report`` writes, one self-contained HTML file.

    Parameters
    ----------
    fit : Fit
        Of any method; a failed one gives a page that says so.
    path : path
        Of the page; an existing one is replaced.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.

    Examples
    --------
    >>> import clutchid, tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     clutchid.report(clutchid.fit(clutchid.bundled_recording().slice(0, 4000)), f"{folder}/page.html")
    ...     "Load" in Path(folder, "page.html").read_text(encoding="utf-8")
    True
    """
    from clutchid.documents import document_of, write_page

    write_page(document_of(fit, "clutchid.fit(...) in Python"), path)


def evidence_of(fit: Fit) -> Evidence:
    """Evidence for the verdict, see `clutchid.estimation.assess.evidence.evidence`."""
    from clutchid.estimation.assess.evidence import evidence

    return evidence(fit)


def verdict_of(fit: Fit) -> Verdict:
    """Whether parameters and load can be trusted, see `clutchid.estimation.assess.verdict.verdict`."""
    from clutchid.estimation.assess.verdict import verdict

    return verdict(fit)


def comparison_of(fit: Fit) -> Comparison | None:
    """The load against that of the baseline, see `clutchid.estimation.assess.comparison`; None without one."""
    from clutchid.estimation.assess.comparison import comparison

    return comparison(fit)


def problem_at_end(fit: Fit) -> FitProblem:
    """The problem of a fit at its end, made anew each time, see `clutchid.estimation.fit_problem`."""
    from clutchid.estimation.fit_problem import problem_of_fit

    return problem_of_fit(fit)


def _printed_fit(fit: Fit) -> str:
    from clutchid.documents.fit import printed_fit

    return printed_fit(fit)


def _in_notebook(shown: Log | Simulation | Fit) -> str:
    from clutchid.documents import document_of
    from clutchid.documents.notebook import notebook_html

    return notebook_html(document_of(shown))


#: Module and name of a class, and what is attached to it.
_ATTACHED: Mapping[tuple[str, str], Mapping[str, Any]] = {
    ("clutchid.log", "Log"): {"plot": plot, "_repr_html_": _in_notebook, "from_frame": staticmethod(from_frame)},
    ("clutchid.simulation.simulation", "Simulation"): {"plot": plot, "_repr_html_": _in_notebook},
    ("clutchid.estimation.result", "Fit"): {
        "plot": plot,
        "report": report,
        "evidence": property(evidence_of),
        "verdict": property(verdict_of),
        "comparison": property(comparison_of),
        "problem": property(problem_at_end),
        "__str__": _printed_fit,
        "_repr_html_": _in_notebook,
    },
}


def attach() -> None:
    """Attach their methods to the classes that have been imported, once."""
    for (module, name), members in _ATTACHED.items():
        kind = getattr(sys.modules.get(module), name, None)
        if kind is not None and "plot" not in vars(kind):
            for member, value in members.items():
                setattr(kind, member, value)
