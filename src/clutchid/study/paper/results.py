"""Results of the study before they are written: cases, pressures, tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from clutchid.log import Log
from clutchid.reports.figures import png
from clutchid.reports.style import BAR, MM
from clutchid.reports.tables import ReportTable
from clutchid.study.paper import figures, tables
from clutchid.study.paper.fits import Case, PaperMethod, Progress, all_cases
from clutchid.study.paper.pressure import Pressures, pressures
from clutchid.study.paper.printed import equation_21
from clutchid.study.paper.recording import TrueLoad, true_load

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Stems of the tables and numbers of the figures that `find` makes.
TABLES = (
    "equation_21",
    "table_1",
    "table_1_carry_q",
    "table_2",
    "table_2_carry_q",
    "verification",
    "pressure_errors",
)
FIGURES = (2, 3, 4, 5, 6, 7, 8)


@dataclass(frozen=True, slots=True, eq=False)
class StudyResults:
    """Results of the study; `second` are the pressures on the second recording by method, p carried."""

    fit_log: Log
    verify_log: Log
    cases: tuple[Case, ...]
    truth: TrueLoad | None
    second: Mapping[PaperMethod, Pressures]
    tables: Mapping[str, ReportTable]
    figures: Mapping[int, bytes]

    def case(self, method: PaperMethod) -> Case:
        """Results of a method."""
        return next(case for case in self.cases if case.method == method)


def find(fit_log: Log, verify_log: Log, progress: Progress) -> StudyResults:
    """Compute the study: all fits, then pressures, tables and figures.

    Raises
    ------
    DataError
        If a recording cannot be fitted.
    SolveError
        If a simulation produces values that are not finite.
    """
    cases = all_cases(fit_log, verify_log, lambda text, part: progress(text, 0.6 * part))
    truth = true_load(fit_log)
    progress("pressure from the load", 0.6)
    paired = tables.rows_of(cases, "p")
    first = {case.method: pressures(case.fit.actuator, case.ballistic) for case in paired}
    second = {case.method: pressures(case.fit.actuator, case.verified) for case in paired}
    made = {
        "equation_21": equation_21(),
        "table_1": tables.table_1(cases, "p"),
        "table_1_carry_q": tables.table_1(cases, "q"),
        "table_2": tables.table_2(cases, "p"),
        "table_2_carry_q": tables.table_2(cases, "q"),
        "verification": tables.verification(cases, truth),
        "pressure_errors": tables.pressure_errors(paired, first, second),
    }
    return StudyResults(fit_log, verify_log, cases, truth, second, made, _figures(cases, second, fit_log, progress))


def _figures(
    cases: Sequence[Case], second: Mapping[PaperMethod, Pressures], log: Log, progress: Progress
) -> dict[int, bytes]:
    thirty_two = next(case for case in cases if case.method == PaperMethod("parts", 32))
    pair = (cases[0], thirty_two)
    makers: dict[int, Callable[[], Figure]] = {
        2: figures.figure_2,
        3: lambda: figures.figure_3(cases),
        4: lambda: figures.figure_4(cases),
        5: lambda: figures.figure_5(cases, log, true_load(log)),
        6: lambda: figures.states_figure(cases[0]),
        7: lambda: figures.states_figure(thirty_two),
        8: lambda: figures.figure_8(pair, [second[case.method] for case in pair]),
    }
    drawn = {}
    for number, make in makers.items():
        progress(f"figure {number}", 0.65 + 0.3 * (number - 2) / len(makers))
        drawn[number] = png(make())
    return drawn


def millimetres(value: float) -> str:
    """A length as text, as in ``0.93 mm``."""
    return f"{value / MM:.2f} mm"


def bars(value: float | None) -> str:
    """A pressure as text, as in ``0.25 bar``."""
    return "not measured" if value is None else f"{value / BAR:.2f} bar"
