"""Page of the study: method, results, and deviations from the paper with their reasons; its words are a template."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from clutchid.documents.document import Bullets, Chapter, Document, Markup, Notice, Picture, Text, sources_of
from clutchid.documents.html import html_templates
from clutchid.documents.style import BAR, MM
from clutchid.documents.tables import ReportTable
from clutchid.study.figures import CLOSE, SLOW_SPEED
from clutchid.study.literal import LITERAL_TABLES
from clutchid.study.pressure import pressures
from clutchid.study.results import BALLISTIC, PARTS_32, PaperMethod, StudyResults, best_possible, load_error, table_rows
from clutchid.study.tables import TABLE_2


def study_page(
    study: StudyResults,
    made: Mapping[str, ReportTable],
    figures: Mapping[int, bytes],
    command: str,
    names: Sequence[str],
) -> Document:
    """The page, not yet rendered, with tables by file stem, figures by number, and names of the files beside it."""
    prose = _template().make_module({**_facts(study), "made": made})

    def text(name: str, *values: Any) -> Text:
        return Text(_paragraph(getattr(prose, name)(*values)))

    def bullets(name: str) -> Bullets:
        return Bullets(tuple(Markup(line) for line in getattr(prose, name)().split("\n") if line))

    def figure(number: int) -> Picture:
        caption = _paragraph(getattr(prose, f"figure_{number}")())
        described = re.sub(r"<.*?>", "", caption).split(". ")[0]
        return Picture(figures[number], Markup(f"<b>Figure {number}.</b> {caption}"), described)

    warnings = dict.fromkeys([*study.case(BALLISTIC).fit.warnings, *study.verify_log.warnings])
    literal = [block for stem in LITERAL_TABLES if stem in made for block in (made[stem], text(stem))]
    sections = (
        Chapter("Changes to the paper", (bullets("key_deviations"),)),
        Chapter("Summary", (text("abstract"), bullets("findings"))),
        Chapter("Method", (text("data"), *map(Notice, warnings), text("method"), text("resets"))),
        Chapter("Basis functions, Eq. (21)", (figure(2), made["equation_21"], text("equation_21"))),
        Chapter("Estimated load, Table 1", (made["table_1"], made["table_1_carry_q"], text("table_1"), figure(5))),
        Chapter("Errors on the first recording, Table 2", (
            made["table_2"], made["table_2_carry_q"], text("table_2"), figure(3), figure(4))),
        Chapter("Verification on the second recording", (
            made["verification"], text("verification"), figure(6), figure(7))),
        Chapter("Pressure from the load, Eq. (26)", (figure(8), made["pressure_errors"], text("pressure_errors"))),
        Chapter("Why the results differ from the paper", (text("differences"),)),
        Chapter("Other deviations from the paper", (bullets("deviations"),)),
        *([Chapter("The paper as printed", tuple(literal))] if literal else []),
        Chapter("Files", (text("files", names),)),
    )  # fmt: skip
    return Document(
        "Clutch load characteristics: the paper's study repeated", _paragraph(prose.subtitle()), command=command,
        sections=lambda: sections, sources=sources_of([study.fit_log, study.verify_log]),
    )  # fmt: skip


@cache
def _template() -> Any:
    environment = html_templates("clutchid.study")
    environment.filters |= {"mm": millimetres, "bar": bars}
    return environment.get_template("prose.html.j2")


def _paragraph(html: Markup) -> Markup:
    """The lines of a macro as one."""
    return Markup(" ".join(html.split()))


def millimetres(value: float) -> str:
    """A length as text, as in ``0.93 mm``."""
    return f"{value / MM:.2f} mm"


def bars(value: float | None) -> str:
    """A pressure as text, as in ``0.25 bar``."""
    return "not measured" if value is None else f"{value / BAR:.2f} bar"


def _facts(study: StudyResults) -> dict[str, Any]:
    """Values in the words of the page."""
    ballistic, rows = study.case(BALLISTIC), table_rows(study.cases, "p")
    fit, parted = ballistic.fit, study.case(PARTS_32)
    error = np.abs(ballistic.fitted.simulated["position"] - ballistic.fitted.measured["position"])
    worst = int(np.nanargmax(error))
    curve = fit.load_curve
    force = fit.actuator.load.force(curve.position)
    half = ((curve.high - curve.low) / 2)[(curve.position >= 5e-3) & (curve.position <= 8e-3)]
    return {
        "study": study, "ballistic": ballistic, "parted": parted,
        "second": pressures(fit.actuator, ballistic.verified),
        "second_parted": pressures(parted.fit.actuator, parted.verified),
        "every_p": study.case(PaperMethod("every", 2)), "every_q": study.case(PaperMethod("every", 2, "q")),
        "worst_error": error[worst], "worst_time": ballistic.fitted.measured.time[worst],
        "rows": rows, "reproducing": _reproducing(study),
        "peak_force": force.max(), "peak_position": curve.position[np.argmax(force)],
        "theta_3": fit.parameters["theta_3"], "half_band": half.max() if np.isfinite(half).all() else None,
        "spread": partial(_spread, study), "load_error": lambda case: study.truth and load_error(case, study.truth),
        "covered": lambda: _covered(study), "best_possible": best_possible,
        "p": fit.actuator.parameters, "np": np, "MM": MM, "BAR": BAR, "SLOW": SLOW_SPEED, "CLOSE": CLOSE,
    }  # fmt: skip


def _spread(study: StudyResults, reading: str, carry: str) -> str:
    """The range of the loads at 8 mm by one interpretation of N."""
    cases = [case for case in study.cases if (case.method.interpretation, case.method.carry) == (reading, carry)]
    at_8 = [case.fit.actuator.load.force(np.array([8e-3]))[0] for case in cases]
    return f"{min(at_8):.0f} to {max(at_8):.0f} N"


def _reproducing(study: StudyResults) -> str:
    """Interpretations of N for which the position errors of ballistic runs have the printed order."""
    page = sorted(TABLE_2, key=lambda n: TABLE_2[n][0])
    same = []
    for reading, words in (("parts", "N equal parts"), ("every", "every N samples")):
        rows = [case for case in table_rows(study.cases, "p") if case.method.interpretation in ("ballistic", reading)]
        rows.sort(key=lambda case: case.ballistic.errors.position_sse)
        same += [words] if [case.method.number for case in rows] == page else []
    return " and with ".join(same) or "neither"


def _covered(study: StudyResults) -> int:
    """Positions at which the band of the ballistic estimate contains the true load."""
    assert study.truth is not None
    curve, truth = study.case(BALLISTIC).fit.load_curve, study.truth
    low, high = (np.interp(truth.position, curve.position, edge) for edge in (curve.low, curve.high))
    return int(np.sum((truth.force >= low) & (truth.force <= high)))
