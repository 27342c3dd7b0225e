"""A fit in Python: what it prints, its table, figure, page and verdict, and recordings that are given as paths."""

import re
from dataclasses import replace
from html import escape
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.errors import DataError, SolveError
from clutchid.inference.uncertainty.estimates import Estimate
from clutchid.log import Log
from clutchid.measurements import write
from clutchid.model import Actuator, Load
from clutchid.model.equipment import Equipment
from clutchid.parameters import Parameters


@pytest.fixture(scope="module")
def short(drive):
    """The first three seconds."""
    return replace(drive.slice(0, 3000), name="short")


@pytest.fixture(scope="module")
def fitted(short, with_noise):
    return clutchid.fit(with_noise(short, 1))


def picture(html: str) -> ElementTree.Element:
    """The only SVG of an HTML text."""
    (svg,) = re.findall(r"<svg.*?</svg>", html, re.DOTALL)
    return ElementTree.fromstring(svg)


def test_a_fit_prints_its_recording_its_status_and_its_parameters_in_a_few_lines(fitted):
    first, *rows = repr(fitted).splitlines()
    assert first.startswith(f"Fit of 'short': {fitted.status}, converged after {fitted.evaluations} evaluations")
    estimate = fitted.parameters["theta_1"]
    assert rows[0] == f"  theta_1 = {estimate.value:.4g} ± {estimate.high - estimate.value:.2g} N/m"
    assert len(rows) == 3 + bool(fitted.warnings)
    assert repr(fitted.load_curve).startswith("LoadCurve(101 points from 0 to 25 mm, greatest 4.")


def test_a_fit_of_many_recordings_and_parameters_prints_the_first_of_them(fitted):
    many = replace(
        fitted,
        recordings={f"day {i}": fitted.recordings["short"] for i in range(9)},
        parameters={f"P_S@{i}": Estimate(1.0, "1", 0.1, 0.8, 1.2) for i in range(50)},
        warnings=("one", "two"),
    )
    lines = repr(many).splitlines()
    assert lines[0].startswith("Fit of 'day 0', 'day 1', 'day 2' and 6 more: ")
    assert lines[1] == "  P_S@0 = 1 ± 0.2"
    assert lines[7:] == ["  and 44 more in .to_frame()", "  2 warnings in .warnings"]


def test_a_notebook_shows_the_load_with_its_band_and_escapes_names(fitted):
    foreign = replace(fitted, recordings={"</pre><script>$": fitted.recordings["short"]})
    html = foreign._repr_html_()
    assert "<script" not in html
    assert escape("</pre><script>$") in html
    assert picture(html).tag.endswith("svg")
    # a style sheet in the picture would apply to the whole notebook; the same fit has the same bytes
    assert "<style" not in html
    assert html == foreign._repr_html_()


def test_a_failed_fit_has_no_picture_and_says_why(fitted):
    failed = replace(fitted, status="failed", message="the start values cannot be simulated.")
    assert "<svg" not in failed._repr_html_()
    assert "cannot be simulated" in failed._repr_html_()
    with pytest.raises(SolveError, match="cannot be simulated"):
        failed.plot()


def test_plots_are_figures_that_pyplot_does_not_know_and_that_a_notebook_shows(fitted):
    figure, content = fitted.plot(), BytesIO()
    figure.savefig(content, format="png")
    assert content.getvalue().startswith(b"\x89PNG")
    assert [axis.get_ylabel() for axis in figure.axes] == ["load [N]"]
    assert picture(figure._repr_svg_()).tag.endswith("svg")


def test_the_table_of_a_fit_has_a_row_for_every_free_parameter(fitted):
    frame = fitted.to_frame()
    assert frame.columns == ["name", "value", "unit", "std", "low", "high"]
    assert frame["name"].to_list() == list(fitted.parameters)
    row = frame.row(by_predicate=pl.col("name") == "theta_2", named=True)
    estimate = fitted.parameters["theta_2"]
    assert (row["value"], row["unit"], row["high"]) == (estimate.value, "N/m", estimate.high)
    assert replace(fitted, parameters={}).to_frame().schema == frame.schema


@pytest.mark.slow
def test_the_page_of_a_fit_has_its_verdict_and_says_where_it_comes_from(blank, fitted, tmp_path):
    fitted.report(tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Clutch load from short" in html
    assert "clutchid.fit(...) in Python" in html
    assert all(escape(reason[1:]) in html for reason in fitted.verdict.reasons)


def test_paths_are_read_where_logs_are_expected(short, tmp_path):
    files = tmp_path / "short.csv", tmp_path / "again.parquet"
    for file in files:
        write(short, file)
    result = clutchid.fit(str(files[0]), verify=files[1])
    expected = clutchid.fit(short)
    assert list(result.recordings) == ["short"]
    assert list(result.verification) == ["again"]
    # CSV has every bit of a value
    assert result.parameters == expected.parameters
    assert list(clutchid.fit([files[0], short]).recordings) == ["short", "short (2)"]
    simulated = clutchid.simulate(Actuator(), files[0]).log
    np.testing.assert_array_equal(simulated["position"], clutchid.simulate(Actuator(), short).log["position"])


@pytest.fixture
def gauge(short, tmp_path):
    """The file of the recording with gauge pressure."""
    table = pl.DataFrame({"time [s]": short.time, "position [m]": short["position"]}).with_columns(
        pl.Series("duty_supply [1]", short["duty_supply"]),
        pl.Series("duty_exhaust [1]", short["duty_exhaust"]),
        pl.Series("pressure_a [bar(g)]", (short["pressure_a"] - 1.095e5) / 1e5),
    )
    table.write_csv(tmp_path / "gauge.csv")
    return tmp_path / "gauge.csv"


def test_gauge_pressures_of_a_path_are_relative_to_the_ambient_pressure_of_the_actuator(short, gauge):
    result = clutchid.fit(gauge, Actuator().replace(P_0=0.95e5), free="theta_1")
    measured = result.recordings["gauge"].measured["pressure_a"]
    np.testing.assert_allclose(measured, short["pressure_a"] - 0.145e5, rtol=1e-12)
    assert result.actuator.parameters.P_0 == 0.95e5


@pytest.mark.parametrize("ambient", [None, 0.95e5])
def test_the_model_vents_to_the_pressure_that_gauge_pressures_count_from(gauge, short, ambient):
    """With P_0 of Appendix A, which nobody has measured, it would vent 8 kPa above the sensor."""
    log, P_0 = clutchid.read(gauge, ambient=ambient), ambient or 1.013e5
    result = clutchid.fit(log, measure=("position", "pressure_a"), free="theta_1")
    assert result.actuator.parameters.P_0 == P_0
    said = (
        f"the ambient pressure, P_0, is {P_0 * 1e-5:.4g} bar, the reference of the gauge pressures, instead of "
        "Appendix A's 1.095 bar."
    )
    assert said in result.notes
    pressure = result.recordings["gauge"].simulated["pressure_a"]
    assert pressure[0] == pytest.approx(log["pressure_a"][0], abs=1.0)
    simulated = clutchid.simulate(Actuator(), log)
    assert said in simulated.warnings
    assert simulated.log["pressure_a"][0] == pytest.approx(P_0)
    if ambient is None:
        assert clutchid.simulate(Actuator(), gauge).log["pressure_a"][0] == pytest.approx(P_0)
    assert clutchid.fit(short).actuator.parameters.P_0 == Parameters().P_0, "absolute pressures say nothing of it"


def test_the_problems_of_all_files_are_named_and_so_is_what_is_no_recording(short, tmp_path):
    (tmp_path / "a.csv").write_text("time [s],position [m]\n0,0\n1,0\n")
    with pytest.raises(DataError) as caught:
        clutchid.fit([tmp_path / "a.csv", short, tmp_path / "b.csv"])
    assert "a.csv" in str(caught.value)
    assert "b.csv" in str(caught.value)
    for wrong in (5, [5]):
        with pytest.raises(
            DataError, match=r"a recording is a clutchid\.Log or the path of a file, not a whole number"
        ):
            clutchid.fit(wrong)
    with pytest.raises(DataError, match="not a list"):
        clutchid.simulate(Actuator(), [short])


def test_load_stands_for_all_load_weights_wherever_parameters_are_named(short):
    assert list(clutchid.fit(short, free="load,P_S").parameters) == ["theta_1", "theta_2", "theta_3", "P_S"]
    simulation = clutchid.simulate(Actuator(), short, sensitivities="load,P_S")
    assert list(simulation.sensitivities) == ["theta_1", "theta_2", "theta_3", "P_S"]
    with pytest.raises(clutchid.ParameterError, match="profile of theta_2, theta_3, which is not free"):
        clutchid.fit(short, free="theta_1", request=clutchid.FitRequest(profile="load"))


def test_a_log_and_a_simulation_print_what_they_have(short):
    text = "Log('short', 3,000 samples from 0 to 2.999 s, 1000 Hz: position, duty_supply, duty_exhaust, pressure_a)"
    assert repr(short) == text
    assert repr(replace(short, warnings=("odd",))) == f"{text[:-1]}; 1 warning)"
    assert repr(Log(np.zeros(0), {})) == "Log('log', 0 samples: no columns)"
    simulation = clutchid.simulate(Actuator(), short, sensitivities="theta_1")
    assert repr(simulation).startswith("Simulation(ok: simulated to the end; Log('short', 3,000 samples")
    assert repr(simulation).endswith("; sensitivities to theta_1)")


@pytest.mark.slow
def test_a_notebook_shows_position_pressure_and_duty_cycles_of_a_log_and_of_a_simulation(short):
    simulation = clutchid.simulate(Actuator(), short)
    for shown in (short, simulation):
        labels = [axis.get_ylabel() for axis in shown.plot().axes]
        assert labels == ["position [mm]", "pressure,\nabsolute [bar]", "duty cycle [1]"]
        assert picture(shown._repr_html_()).tag.endswith("svg")
    position, pressure, _ = short.plot().axes
    assert position.lines[0].get_ydata().max() == pytest.approx(short["position"].max() / 1e-3)
    assert pressure.lines[0].get_ydata().max() == pytest.approx(short["pressure_a"].max() / 1e5)
    assert "<b>" not in replace(short, name="<b>")._repr_html_()


@pytest.mark.parametrize("n", [0, 1, 2])
def test_a_log_with_hardly_anything_in_it_can_be_shown(n):
    for columns in ({}, {"position": np.full(n, np.nan)}, {"force": np.zeros(n), "z_1 [m]": np.zeros(n)}):
        assert picture(Log(np.arange(float(n)), columns)._repr_html_()).tag.endswith("svg")


def test_values_are_replaced_by_name_or_by_a_mapping():
    start = Actuator()
    assert start.replace(P_S=7e5, theta_1=8e5) == start.replace({"P_S": 7e5, "theta_1": 8e5})
    assert start.parameters.replace(P_S=7e5) == start.parameters.replace({"P_S": 7e5})
    assert start.parameters.replace({"P_S": 7e5}, F_C=1.0).F_C == 1.0
    with pytest.raises(clutchid.ParameterError, match="did you mean 'P_S'"):
        start.replace(P_s=7e5)


def test_an_actuator_prints_what_differs_from_the_paper_and_can_be_read_back():
    assert repr(Actuator()) == "Actuator()"
    changed = Actuator(Parameters(F_C=150.0), Load((1.0, 2.0, 3.0)), "energy-balance", Equipment(chamber_b=False))
    assert eval(repr(changed)) == changed
    assert len(repr(changed)) < 400


def test_the_version_is_that_of_the_installed_package():
    assert re.fullmatch(r"\d+\.\d+\.\d+.*", clutchid.__version__)
    assert "__version__" in dir(clutchid)


def test_the_package_says_that_it_has_types(source):
    assert (source / "py.typed").is_file()
