"""A fit in ten lines: what each row says, and that no row says what is not known."""

import re
from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.document import On
from clutchid.documents.fit_json import fit_json
from clutchid.documents.fit_rows import LARGEST_HALF, baseline_name, other_warnings, with_interval
from clutchid.documents.html import page_of
from clutchid.documents.terminal import text_of
from clutchid.estimation import Estimate, LoadCurve
from clutchid.estimation.result import Change
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.inference.uncertainty.conditions import Assumption
from clutchid.numerics.least_squares import Start
from fixtures.baselines import ORIGIN, calibration_like, reaching, with_baseline

VALVES = "valves"


def rows_on(fit, medium=On.BRIEF):
    return document_of(fit).rows_on(medium)


def rows_of(fit, label, medium=On.BRIEF):
    """Texts of the rows under a label, and of those that follow without one."""
    texts, current = [], ""
    for row in rows_on(fit, medium):
        current = row.label or current
        texts += [row.text] if current == label else []
    return texts


def with_band(fit, half):
    curve = fit.load_curve
    return replace(fit, load_curve=LoadCurve(curve.position, curve.force, curve.force - half, curve.force + half))


def change(name="C_vs", group=VALVES, probability=0.9, recording="first"):
    return Change(recording, name, 1.9e-8, 2.1e-8, 1e-10, "m³/(Pa·s)", probability, group)


def test_the_rows_are_trust_load_what_is_assumed_and_errors(fitted):
    assert [row.label for row in rows_on(fitted)] == ["trust", "", "load", "", "assumed", "errors"]
    assert rows_on(fitted)[1].text == fitted.verdict.experience
    assert rows_on(fitted)[0].mood == rows_on(fitted)[0].text == fitted.verdict.trust == "good"
    assert rows_on(replace(fitted, converged=False))[0].mood == "with care"


def test_the_load_has_its_peak_half_and_a_table_of_the_positions_where_the_clutch_engages(fitted):
    text, table = rows_of(fitted, "load")
    curve = fitted.load_curve
    assert re.match(r"greatest \d{4} ± \d+ N at \d+\.\d mm of the recorded \d+\.\d mm; half of it at \d\.\d\d mm", text)
    heading, loads = table.splitlines()
    assert heading.split() == ["5", "mm", "6", "mm", "7", "mm", "8", "mm"]
    shown = [int(number) for number in re.findall(r"(\d+) ±", loads)]
    assert shown == pytest.approx([np.interp(mm * 1e-3, curve.position, curve.force) for mm in (5, 6, 7, 8)], abs=0.5)


@pytest.mark.slow
def test_what_is_assumed_of_the_conditions_is_said_with_its_range_and_what_it_is_worth(blank, fitted):
    assumed = (Assumption("P_S", ("first",), 8.9e5, 0.54e5, False), Assumption("T_0", ("first",), 293.15, 13.6, True))
    fit = replace(with_baseline(fitted), assumed=assumed, load_per_supply=0.73)
    supply, air = rows_of(fit, "assumed")
    assert supply == (
        "supply pressure not recorded: the calibrated value is assumed, 8.90 ± 0.54 bar; outside this range the "
        "band is wrong, and the position alone cannot show that; a 1 % higher supply pressure changes this load by "
        "0.7 %. Record pressure_supply here and in the calibration to halve the band"
    )
    assert fit_json(fit)["load_per_supply"] == 0.73
    assert rows_of(replace(fit, load_per_supply=None), "assumed")[0] == supply.partition(";")[0]
    assert air == "air temperature not recorded in the calibration: the calibrated value is assumed, 20 ± 14 °C"
    assert {supply, air} <= set(fit_json(fit)["notes"])
    assert supply in text_of(rows_on(fit, On.FULL), 1000)
    page = page_of(document_of(fit, "clutchid fit"))
    assert all(text in page for text in (supply, air))
    assert rows_of(with_baseline(fitted), "assumed") == []


@pytest.mark.parametrize("half", [np.inf, np.nan, LARGEST_HALF])
def test_a_load_that_is_not_determined_has_its_value_and_no_interval(fitted, half):
    text, table = rows_of(with_band(fitted, half), "load")
    assert re.match(r"greatest \d{4} N \(interval not determined\) at ", text)
    assert "(2" not in text.partition("half of it")[2]
    assert table.count("not determined") == 4


def test_beyond_the_reach_there_is_a_dash(fitted):
    for share, dashes in ((0.4, 2), (0.3, 4)):
        low = reaching(with_baseline(fitted), share)
        furthest = 1e3 * np.nanmax(low.recordings["first"].measured["position"])
        assert dashes == sum(mm > furthest for mm in (5, 6, 7, 8))
        lines = rows_of(low, "load")[1].splitlines()
        assert [line.split().count("-") for line in lines] == [0, dashes, dashes, dashes]


def test_a_load_that_was_not_freed_has_no_interval_and_is_said_to_be_fixed(fitted):
    own = {"P_S": Estimate(9e5, "Pa", 1e3, 8.98e5, 9.02e5)}
    fixed = replace(with_band(with_baseline(fitted), 0.0), parameters=own, covariance=np.array([[1e6]]))
    text, table = rows_of(fixed, "load")
    assert text.endswith("fixed, not fitted")
    assert "±" not in text + table
    assert rows_of(fixed, "also") == ["P_S = 9e+05 ± 2e+03 Pa"]
    (since,) = rows_of(fixed, "since")
    assert since.endswith("no change found")


def test_what_changed_since_the_calibration_is_its_load_shift_and_other_changes(fitted):
    calibration = with_baseline(fitted, share=0.8)
    lines = rows_of(calibration, "load")[1].splitlines()
    assert lines[3].split() == ["+25", "%"] * 4
    (since,) = rows_of(calibration, "since")
    assert since.startswith("CAL.toml (2026-11-22, trust good): half-load position +0.00 mm")
    assert since.endswith("no other change found")
    (since,) = rows_of(replace(calibration, changes=(change(), change("C_ve"))), "since")
    assert f"{VALVES} changed in first (90 %: C_vs from 1.9·10⁻⁸ to 2.1·10⁻⁸ m³/(Pa·s), C_ve" in since
    assert "no other" not in since


@pytest.mark.parametrize(
    ("origin", "name"),
    [
        (ORIGIN, "CAL.toml (2026-11-22, trust good)"),
        (ORIGIN._replace(trust="", created=""), "CAL.toml"),
        (ORIGIN._replace(created=""), "CAL.toml (trust good)"),
        (Origin(), "the calibration"),
        (None, "the calibration"),
    ],
)
def test_a_calibration_is_named_by_what_is_known_of_it(fitted, origin, name):
    assert baseline_name(calibration_like(fitted, origin=origin)) == name
    (since,) = rows_of(with_baseline(fitted, origin=origin), "since")
    assert since.startswith(f"{name}: half-load")


def test_a_calibration_of_an_older_file_says_that_its_load_is_not_there(fitted):
    older = with_baseline(fitted, theta=(), theta_covariance=np.zeros((0, 0)))
    assert len(rows_of(older, "load")[1].splitlines()) == 2
    (since,) = rows_of(older, "since")
    assert "the file has no load" in since


def test_without_a_calibration_the_truck_of_the_paper_is_said_to_be_assumed(fitted):
    assert rows_of(fitted, "assumed") == ["parameters not fitted are those of the paper's truck: no calibration"]
    other = replace(fitted, actuator=fitted.actuator.replace({"P_S": 8e5}))
    assert rows_of(other, "assumed") == []
    assert rows_of(replace(fitted, calibration=calibration_like(fitted)), "assumed") == []


def test_recordings_read_alone_have_a_line_each(fitted):
    calibration = with_baseline(fitted)
    readings = {"[red]day 1": calibration, "day 2": with_baseline(fitted, share=1.0), "unread": fitted}
    lines = rows_of(replace(calibration, readings=readings), "alone")
    assert len(lines) == 2
    assert re.fullmatch(r"\[red\]day 1: \+\d+ N \(\+25 %\) at 6 mm, half-load \+0\.00 mm, trust good", lines[0])
    assert lines[1].startswith("day 2: +0 N (+0 %) at 6 mm")


def test_a_recording_that_stays_below_6_mm_is_read_alone_without_the_change_there(fitted):
    low = reaching(with_baseline(fitted), 0.3)
    (line,) = rows_of(replace(low, readings={"low": low}), "alone")
    assert line.startswith("low: no load at 6 mm, ")


def test_a_few_other_parameters_are_shown_and_many_are_counted(fitted):
    def having(count):
        own = {name: Estimate(9e5, "Pa", 1e3, 8.98e5, 9.02e5) for name in ("P_S", "C_vs", "C_ve", "F_C", "M")[:count]}
        own["C_vs"] = replace(own["C_vs"], high=np.inf)
        free = {**fitted.parameters, **own, "P_S@first": own["P_S"]}
        return replace(fitted, parameters=free, covariance=np.diag([e.std**2 for e in free.values()]))

    assert rows_of(having(2), "also") == ["P_S = 9e+05 ± 2e+03 Pa, C_vs = not determined"]
    (text,) = rows_of(having(5), "also")
    assert text.startswith("5 other parameters were fitted")
    assert rows_of(fitted, "also") == []


def test_errors_are_said_to_be_over_windows_where_they_are_and_many_verified_ones_are_counted(fitted):
    (text,) = rows_of(replace(fitted, method="shooting"), "errors")
    assert "rms over windows of 0.1 s; checked, verified: position" in text
    many = {f"v{i}": recording for recording in fitted.verification.values() for i in range(4)}
    (text,) = rows_of(replace(fitted, verification=many), "errors")
    assert text.endswith("2 more: --verbose")
    assert "v1, verified" in text
    assert "v2" not in text


def test_two_reasons_are_shown_and_in_full_all_of_them(fitted):
    bounds = {name: (e.value, e.value) for name, e in fitted.parameters.items()}
    doubtful = replace(with_baseline(reaching(fitted, 0.45), converged=False), converged=False, bounds=bounds)
    reasons = doubtful.verdict.reasons
    assert len(reasons) > 3
    assert rows_of(doubtful, "trust") == ["none", *reasons[:2], f"{len(reasons) - 2} more reasons: --verbose"]
    assert rows_of(doubtful, "trust", On.FULL) == ["none", *reasons]


def test_in_full_nothing_stands_in_the_summary_and_in_the_text_below(fitted):
    calibrated = replace(with_baseline(fitted), changes=(change(),))
    text = text_of(rows_on(calibrated, On.FULL))
    for once in (VALVES, "fitted first: position", "The search converged"):
        assert text.count(once) == 1, once
    for name in calibrated.parameters:
        assert f"\n{name} " in text
    assert "no other change" in "\n".join(rows_of(with_baseline(fitted), "since", On.FULL))


def test_several_starts_have_a_line_in_full_and_a_single_one_has_none(fitted):
    starts = Start("initial values", 12.5, "stalled"), Start("new states 1", 9990.1, "converged")
    text = text_of(rows_on(replace(fitted, starts=starts), On.FULL))
    assert "Cost of 2 starts: initial values 12.5 (stalled), new states 1 9990" in text
    assert "starts" not in text_of(rows_on(replace(fitted, starts=starts), On.BRIEF))
    assert "starts" not in text_of(rows_on(replace(fitted, starts=starts[:1]), On.FULL))


def test_the_sentences_in_full_are_wrapped(fitted):
    noted = replace(fitted, notes=("a long note " * 20,))
    assert max(map(len, text_of(rows_on(noted, On.FULL)).splitlines())) <= 80


def test_a_warning_that_is_a_reason_of_the_verdict_is_not_said_twice(fitted):
    warnings = (
        "theta_1 lies at its lower bound 0 N/m.", f"the search {fitted.message}.", "2 s are missing", "theta_10 lies"
    )  # fmt: skip
    assert other_warnings(replace(fitted, warnings=warnings)) == ["2 s are missing", "theta_10 lies"]


def test_a_difference_that_rounds_to_0_has_no_minus():
    assert with_interval(-0.2, 3.0, "+") == "+0 ± 3"
    assert with_interval(-0.2, 3.0) == "0 ± 3"
