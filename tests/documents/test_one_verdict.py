"""One verdict: the same grade and the same reasons in terminal, page, JSON, notebook and `print(fit)`."""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.document import On
from clutchid.documents.fit_json import fit_json
from clutchid.documents.fit_rows import other_warnings
from clutchid.documents.html import page_of
from clutchid.documents.terminal import text_of
from clutchid.estimation.assess.verdict import verdict
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.next_step import next_step
from fixtures.baselines import calibration_like, two_states, with_baseline

pytestmark = pytest.mark.usefixtures("blank")

COMMAND = FitCommand(verb="fit", logs=(Path("new.csv"), Path("worn.csv")), start=Path("CAL.toml"))


def at_bound(fit, name, end):
    """The fit with an estimate at the lower (0) or upper (1) end of its range, which is physical or not."""
    value = fit.parameters[name].value
    low, high = (value, np.inf) if end == 0 else (-np.inf, value)
    return replace(fit, bounds={**fit.bounds, name: (low, high)})


def flat(text):
    """Text without tags, escapes and breaks of lines."""
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", re.sub(r"base64,[\w+/=]+", "", text))).split())


@pytest.fixture
def shown(fitted):
    """The verdict as every place shows it: (where, text)."""

    def show(fit):
        document = document_of(fit, "c")
        terminal = text_of(document.rows_on(On.FULL), 10_000)
        text = json.dumps(document.data(), ensure_ascii=False)
        page, printed, notebook = flat(page_of(document)), flat(str(fit)), flat(fit._repr_html_())
        return {"terminal": terminal, "page": page, "JSON": text, "print": printed, "notebook": notebook}

    return show


@pytest.mark.slow
@pytest.mark.parametrize("case", ["good", "at a bound", "two states"])
def test_every_place_shows_the_same_grade_and_the_same_reasons(fitted, shown, case):
    fit = {"good": fitted, "at a bound": at_bound(fitted, "theta_1", 1), "two states": two_states(fitted)}[case]
    judged = verdict(fit)
    assert judged.trust == ("good" if case == "good" else "with care")
    assert len(judged.reasons) == (case != "good")
    places = shown(fit)
    for where, text in places.items():
        for reason in judged.reasons:
            assert reason[1:] in text, where  # a page begins it with a capital
    assert document_of(fit).rows[0].text == fit_json(fit)["trust"] == judged.trust
    assert f"trust: {judged.trust}" in places["print"]
    assert all(f"trust {judged.trust} {judged.meaning}" in places[where] for where in ("notebook", "page"))


@pytest.mark.slow
def test_what_is_no_reason_is_a_note_of_the_verdict_and_no_warning(fitted, shown):
    # a lag cannot be negative: at 0 the estimate of a fit with priors lies at a physical limit
    own = replace(fitted.parameters["theta_1"], value=0.0)
    limit = replace(
        fitted, method="shooting", parameters={**fitted.parameters, "tau_y": own}, covariance=np.diag([1.0] * 4),
        bounds={**fitted.bounds, "tau_y": (0.0, np.inf)}, calibration=calibration_like(fitted),
    )  # fmt: skip
    (note,) = limit.verdict.notes
    assert note.startswith("tau_y (lower) lies at a physical limit: no reason against the load")
    assert not any("bound" in reason for reason in limit.verdict.reasons)
    places = shown(limit)
    assert all(note[1:] in places[where] for where in ("terminal", "page", "JSON"))
    assert fit_json(limit)["verdict"]["notes"] == [note]
    assert "Read the warnings" not in places["page"]


@pytest.mark.slow
def test_a_warning_that_the_verdict_has_as_a_reason_is_on_the_page_once(fitted):
    bounded = at_bound(fitted, "theta_1", 1)
    warnings = ("theta_1 lies at its upper bound 9e5 N/m.", "2 s are missing")
    bounded = replace(bounded, status="warning", warnings=warnings)
    page = flat(page_of(document_of(bounded, "c")))
    assert page.count("theta_1 lies at its") == 0
    assert page.count("theta_1 (upper) lies at its bound") == 1
    assert "2 s are missing" in page
    assert other_warnings(bounded) == ["2 s are missing"]


@pytest.mark.slow
def test_two_states_of_wear_are_no_change_of_the_valves_and_lead_to_track(fitted, shown):
    fit = two_states(fitted)
    places = shown(fit)
    assert not any("valves changed" in text for text in places.values())
    assert "the fit attributed the difference to valves: the actuator itself has not changed" in places["page"]
    states_of_wear = fit_json(fit)["states_of_wear"]
    assert states_of_wear["groups"] == [["new"], ["worn"]]
    assert states_of_wear["recordings"] == ["new", "worn"]
    assert states_of_wear["load_percent"] == pytest.approx(20.0)
    assert 0.0 < states_of_wear["load_allowed_percent"] < 20.0
    _, why, what = next_step(fit, COMMAND)
    assert why == "follow the wear"
    assert what == "clutchid track new.csv worn.csv --start CAL.toml --out WEAR.parquet"
    assert fit_json(with_baseline(fitted))["states_of_wear"] is None


@pytest.mark.slow
def test_every_place_says_that_an_interval_without_a_calibration_is_noise_only(fitted, shown):
    said = verdict(fitted).experience
    assert said.startswith(
        "± includes only noise: on virtual trucks the median error of such a load was 18 % of its peak"
    )
    places = shown(fitted)
    assert [where for where, text in places.items() if said not in text] == []
    assert "± includes only noise" in verdict(fitted).meaning
    assert fit_json(fitted)["verdict"]["noise_only"]
    reading = with_baseline(fitted)
    assert not fit_json(reading)["verdict"]["noise_only"]
    assert [where for where, text in shown(reading).items() if "noise only" in text] == []


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda fit: {"actuator": fit.actuator.replace({"P_S": 8e5})}, "of another truck than that of the paper"),
        (lambda fit: {"scales": {**fit.scales, "pressure_a": 1e3}}, "with pressure"),
        (lambda fit: {"actuator": fit.actuator.replace({"theta_1": 9e5, "F_C": 400.0})}, "with another friction"),
        (lambda fit: {"method": "shooting"}, "by another method"),
    ],
)
def test_a_fit_without_a_calibration_that_virtual_trucks_did_not_make_has_no_figures_of_theirs(fitted, change, what):
    judged = verdict(replace(fitted, **change(fitted)))
    assert judged.noise_only, what
    assert judged.experience == "± includes only noise, not errors of the assumed parameters."


def test_a_calibration_and_a_load_that_is_not_fitted_have_no_such_words(fitted):
    weights = fitted.actuator.load.names
    fixed = replace(fitted, parameters={n: e for n, e in fitted.parameters.items() if n not in weights})
    for fit in (replace(fitted, calibration=calibration_like(fitted)), with_baseline(fitted), fixed):
        assert not verdict(fit).noise_only
        assert "noise" not in verdict(fit).experience
