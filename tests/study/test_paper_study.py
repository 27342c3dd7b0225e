"""The study as a whole: its files, its page, and what it refuses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents.tables import to_csv
from clutchid.errors import DataError, ExportError
from clutchid.log import Log
from clutchid.study import output as paper
from clutchid.study import paper_study
from clutchid.study.bundled import true_load
from clutchid.study.figures import FIGURES, figure_5
from clutchid.study.literal import LITERAL_TABLES
from clutchid.study.results import StudyResults
from clutchid.study.tables import TABLES, equation_21
from fixtures.figures import legends_on_the_engaging_range

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def html(study):
    return study.page.read_text(encoding="utf-8")


def test_the_folder_holds_the_page_seven_figures_and_a_csv_for_every_table(study):
    names = {path.name for path in study.page.parent.iterdir()}
    assert names == {"index.html", *(f"figure_{n}.png" for n in range(2, 9)), *(f"{stem}.csv" for stem in study.tables)}
    assert names == {path.name for path in study.files}
    assert set(study.tables) == {*TABLES, *LITERAL_TABLES}
    assert tuple(range(2, 9)) == tuple(FIGURES)


def test_every_csv_file_is_its_table(study):
    for stem, table in study.tables.items():
        assert (study.page.parent / f"{stem}.csv").read_text(encoding="utf-8") == to_csv(table)


def test_every_figure_is_a_picture_and_stands_on_the_page(study, html):
    for number in range(2, 9):
        assert (study.page.parent / f"figure_{number}.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
        assert f"<b>Figure {number}.</b>" in html
    assert html.count("<img ") == 7


def test_a_force_is_in_newtons_and_no_legend_covers_a_load_where_the_clutch_engages(study, html, logs):
    figure = figure_5(study.cases, logs[0], None)
    assert [axis.get_ylabel() for axis in figure.axes] == ["load [N]"] * 4
    assert not re.search(r"\bkN\b", re.sub(r"base64,[A-Za-z0-9+/=]+", "", html))
    assert legends_on_the_engaging_range(figure) == 0


def test_the_printed_loads_of_another_truck_have_nothing_of_this_recording_beside_them(study, logs):
    panels = figure_5(study.cases, logs[0], true_load(logs[0])).axes
    labels = [{line.get_label() for line in axis.get_lines()} for axis in panels]
    of_this = {"true load", "Eq. (25), slow"}
    assert [of_this & label for label in labels] == [of_this, of_this, of_this, set()]


def test_the_page_loads_nothing_and_every_number_of_every_table_stands_on_it(study, html, loads_nothing):
    assert loads_nothing(html)
    for table in study.tables.values():
        for row in table.rows:
            for column, cell in zip(table.columns, row, strict=True):
                assert f">{column.shown(cell)}<" in html


def test_intervals_on_the_page_are_95_percent_and_the_table_has_standard_errors(study, html):
    (weights,) = re.findall(r"θ = \((.*?)\)·10⁵ N/m \(95 % intervals, noise only\)", html)
    halves_shown = [float(half) for half in re.findall(r"± ([\d.]+)", weights)]
    table = study.tables["table_1"]
    at = [i for i, column in enumerate(table.columns) if column.heading == "standard\nerror"]
    ballistic = next(row for row in table.rows if row[0] == "ballistic")
    errors = [ballistic[i] / 1e5 for i in at]
    # Student's quantile is at least the normal one, 1.960; three decimals are shown
    assert all(half >= 1.95 * std - 5e-4 for half, std in zip(halves_shown, errors, strict=True))


def test_the_page_lists_every_deviation(html):
    changed = re.findall(r"<h2>(?:Changes to|Other deviations from) the paper</h2>(.*?)</section>", html, re.DOTALL)
    heads = re.findall(r"<li><b>(.*?)</b>", " ".join(changed))
    assert len(heads) == 17
    assert {"Chamber B.", "Exhaust valve.", "N and resets.", "End stops.", "Table 2.", "Solver."} <= set(heads)


def test_the_page_begins_with_the_key_deviations_and_links_to_the_others_and_to_the_paper_as_printed(html):
    first = html.split("<section id=")[1]
    assert "<h2>Changes to the paper</h2>" in first
    headings = dict(re.findall(r'<section id="(\w+)">\s*<h2>(.*?)</h2>', html))
    links = [headings[name] for name in re.findall(r'href="#(\w+)"', first)]
    assert links == ["Other deviations from the paper", "The paper as printed"]


def test_the_page_says_that_the_data_are_simulated_and_how_to_repeat_it(study, html, logs):
    assert "simulated, not measured" in html
    assert '<p class="subtitle">A simulated recording of a virtual truck, ' in html
    assert f"clutchid paper --literal --out {study.page.parent}" in html
    assert logs[0].metadata["sha256"] in html


def test_progress_goes_from_nothing_to_all_and_never_back(study, heard):
    fractions = [fraction for _, fraction in heard]
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert heard[0][0] == "fit: ballistic"


def test_a_study_without_pressure_and_without_a_known_load_is_whole(blank, drive, tmp_path):
    log = replace(drive.without("pressure_a"), name="mine & <yours>")
    study = paper_study(log.slice(0, 1500), replace(log.slice(1500, 3000), warnings=("mind <this>",)), tmp_path)
    html = study.page.read_text(encoding="utf-8")
    assert "true load is unknown" in html
    assert '<p class="subtitle">After Langjord' in html
    assert "mine &amp; &lt;yours&gt;" in html
    assert "<yours>" not in html
    assert '<p class="notice with-care">mind &lt;this&gt;</p>' in html
    assert set(study.tables["table_2"].column("fitted_pressure_a_rms")) == {None}
    assert set(study.tables["pressure_errors"].column("second_balanced_measured")) == {None}
    assert "load_rms" not in to_csv(study.tables["verification"])
    assert "clutchid paper --fit" in html
    assert "as printed</h2>" not in html
    # The data were made by the model itself: the ballistic fit finds the weights that made them.
    assert study.cases[0].fit.parameters["theta_1"].value == pytest.approx(9e5, rel=1e-5)


@pytest.mark.parametrize("out", ["file", "file/out"])
def test_a_folder_that_is_a_file_or_below_one_is_refused_in_one_sentence(logs, tmp_path, out):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ExportError, match=r"^--out .*: the folder cannot be created"):
        paper_study(*logs, tmp_path / out)
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("out", [".", "out", "a/b/out", "new/.."])
def test_a_study_that_fails_removes_what_it_made_and_leaves_older_files_as_they_were(logs, tmp_path, out):
    (tmp_path / "index.html").write_text("old")
    useless = Log(np.arange(5.0), {"position": np.zeros(5)})
    with pytest.raises(DataError, match=r"nothing can be (fitted|learned)|too few samples"):
        paper_study(useless, logs[1], tmp_path / out)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_a_study_that_cannot_write_its_last_file_leaves_nothing_in_a_new_folder(logs, tmp_path, monkeypatch):
    def without_cases(fit_log, verify_log, progress):
        return StudyResults(fit_log, verify_log, (), None)

    def full(content, path):
        if path.name == "index.html":
            raise ExportError(f"{path}: no space left")
        path.write_bytes(content)

    monkeypatch.setattr(paper, "find", without_cases)
    monkeypatch.setattr(paper, "TABLES", dict.fromkeys(TABLES, lambda study: equation_21()))
    monkeypatch.setattr(paper, "FIGURES", dict.fromkeys(FIGURES, lambda study: None))
    monkeypatch.setattr(paper, "png", lambda figure: b"picture")
    monkeypatch.setattr(paper, "study_page", lambda study, tables, figures, command, names: None)
    monkeypatch.setattr(paper, "page_of", lambda page: "page")
    monkeypatch.setattr(paper, "write_bytes", full)
    with pytest.raises(ExportError, match="no space left"):
        paper_study(*logs, tmp_path / "new" / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["index.html", "figure_2.png", "figure_8.png", "table_1.csv", "pressure_errors.csv"])
def test_a_folder_in_the_place_of_a_file_is_refused_before_the_study(name, logs, tmp_path):
    (tmp_path / name).mkdir()
    with pytest.raises(ExportError, match=f"{name}: .*folder") as caught:
        paper_study(*logs, tmp_path, lambda *told: pytest.fail("the study was begun"))
    assert len(str(caught.value).splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]
