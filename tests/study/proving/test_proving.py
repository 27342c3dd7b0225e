"""The proving ground: the same result for any number of workers, kept, resumed, scored by hand-made answers."""

import json
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from clutchid import processes
from clutchid.cli.prove import prove as command
from clutchid.documents.tables import to_text
from clutchid.errors import ExportError, ParameterError
from clutchid.fleets.cluster import Workers
from clutchid.study.proving import Answer, score, scores, standings, workflows
from clutchid.study.proving import ground as proving
from clutchid.study.proving.scores import coverage, every_recording
from clutchid.study.proving.workflows import workflow
from clutchid.truck import GRID
from fixtures.commands import backwards, without_workers

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def ground():
    return proving.proof(3)


@pytest.fixture
def short(monkeypatch):
    """Recordings of 3 s, where no number hangs on their length."""
    monkeypatch.setattr(proving, "SECONDS", 3.0)


def perfect(driven, **changes):
    """An answer that is the truth, but for `changes`."""
    y = np.linspace(0, 0.025, 501)
    load = driven.truth.load(y)
    values = {"position": y, "force": load, "low": load - 1, "high": load + 1} | {
        "pressure_a": driven.truth.states["pressure_a"].copy()
    }
    return Answer(**(values | changes))


def test_the_truth_itself_scores_zero_and_full_coverage(ground):
    for driven in ground.worn:
        scored = score(perfect(driven), driven.truth, driven.log.time)
        peak = driven.truth.load(GRID).max()
        # 50 µm between the answer's points: the curve bends by less than f'' h^2 / 8 = 1 N there
        assert scored.load < 1 / peak * 100
        assert scored.load_touch < 1 / peak * 100
        assert abs(scored.half_load) < 1e-3
        assert scored.pressure == pytest.approx(0, abs=1e-9)


def test_each_error_is_what_a_hand_makes_it(ground):
    driven = ground.worn[0]
    truth = perfect(driven)
    peak = driven.truth.load(GRID).max()
    shifted = score(perfect(driven, force=truth.force + 0.01 * peak), driven.truth, driven.log.time)
    assert shifted.load == pytest.approx(1.0, rel=0.02)
    assert shifted.load_touch == pytest.approx(1.0, rel=0.02)
    assert shifted.half_load < 0
    high = score(perfect(driven, pressure_a=truth.pressure_a + 7e3), driven.truth, driven.log.time)
    assert high.pressure == pytest.approx(7.0)
    half = np.where(truth.position <= 0.010, 1e4, -1.0)
    banded = score(perfect(driven, low=truth.force - 1e4, high=truth.force + half), driven.truth, driven.log.time)
    assert banded.coverage == pytest.approx(0.5, abs=0.03)


def test_an_answer_that_is_not_finite_or_too_short_is_refused(ground):
    driven = ground.worn[0]
    truth = perfect(driven)
    for broken in (
        perfect(driven, force=np.full(truth.force.size, np.nan)),
        perfect(driven, **{k: getattr(truth, k)[:200] for k in ("position", "force", "low", "high")}),
    ):
        with pytest.raises(ValueError, match="finite from"):
            score(broken, driven.truth, driven.log.time)


def test_the_worn_recordings_have_no_pressure_and_another_load(ground):
    assert "pressure_a" in ground.calibration.log
    for driven in ground.worn:
        assert "pressure_a" not in driven.log
        assert len(driven.log) == 30000
        change = np.abs(driven.truth.load(GRID) - ground.calibration.truth.load(GRID)).max()
        assert change > 0.01 * driven.truth.load(GRID).max()


def test_results_do_not_depend_on_workers_and_a_stopped_run_goes_on(short, tmp_path, monkeypatch):
    with without_workers():
        alone = proving.prove("paper", [0, 1, 2], tmp_path / "one")
        stopped = proving.prove("paper", [1], tmp_path / "two")
    calls = []
    with backwards() as workers:
        place = Workers(2)
        pair = proving.prove("paper", [0, 1, 2], tmp_path / "two", place=place, progress=lambda *a: calls.append(a))
    assert workers == [2]
    assert [r["truck"] for r in pair] == [0, 1, 2]
    assert pair[1] == stopped[0]
    for a, b in zip(alone, pair, strict=True):
        # numbers, not times, are the same; logs hold curves, scores and parameters to the last digit
        assert json.dumps(a["logs"]) == json.dumps(b["logs"])
    assert calls == [(1, 2), (2, 2)]
    assert all(result["logs"] for result in pair)
    monkeypatch.setattr(processes, "results", lambda *_: pytest.fail("a kept result was computed again"))
    assert proving.prove("paper", [0, 1, 2], tmp_path / "two") == pair
    assert proving.stored_results(tmp_path / "two", range(3)) == {"paper": pair}


def test_a_workflow_that_ends_its_process_fails_for_that_truck_only(tmp_path, monkeypatch):
    (tmp_path / "deadly_workflow.py").write_text(
        "import os, signal\n"
        "def run(calibration, worn):\n"
        "    if calibration.metadata['seed'] == os.environ['DEADLY']:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    raise ValueError('no idea')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("DEADLY", proving.proof(6).calibration.log.metadata["seed"])
    results = proving.prove("deadly_workflow:run", [6, 7], tmp_path / "out")
    assert ["SIGKILL" in result["failed"] for result in results] == [True, False]
    assert [result["truck"] for result in results] == [6, 7]
    assert proving.prove("deadly_workflow:run", [6, 7], tmp_path / "out") == results


def test_a_workflow_that_fails_is_a_row_with_its_reason(short, tmp_path, monkeypatch):
    (tmp_path / "broken_workflow.py").write_text("def run(calibration, worn):\n    raise ValueError('no idea')\n")
    monkeypatch.syspath_prepend(tmp_path)
    with without_workers():
        (result,) = proving.prove("broken_workflow:run", [5], tmp_path / "out")
    assert result["failed"] == "ValueError: no idea"
    results = proving.stored_results(tmp_path / "out", [5])
    table = standings(results)
    assert table.column("failed") == (1,)
    assert every_recording(results).column("failed") == ("ValueError: no idea",)
    assert coverage([result]) == (None, None)


#: A workflow that computes nothing, so that runs at the same time meet in the folder and not at the processor.
QUICK = """
import numpy as np
from clutchid.study.proving.scores import Answer

def run(calibration, worn):
    grid = np.linspace(0.0, 0.025, 501)
    return [Answer(grid, 4e3 + 0 * grid, 3e3 + 0 * grid, 5e3 + 0 * grid, np.full(len(log), 2e5)) for log in worn]
"""


def test_two_runs_at_the_same_time_in_one_folder_end_with_the_same_whole_results(tmp_path):
    (tmp_path / "quick_workflow.py").write_text(QUICK)
    words = "-m clutchid prove --out both --workflow quick_workflow:run --workers 1"
    command = [sys.executable, *words.split()]
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    runs = [
        subprocess.Popen(
            [*command, "--trucks", count], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths},
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for count in ("1", "2")
    ]  # fmt: skip
    ended = [(*run.communicate(timeout=120), run.returncode) for run in runs]
    assert [(errors, code) for _, errors, code in ended] == [("", 0), ("", 0)]
    names = {path.name for path in (tmp_path / "both").rglob("*") if path.is_file()}
    trucks = {f"truck_{n:05d}.json" for n in range(2)}
    assert names == trucks | {"settings.json", "standings.csv", "recordings.csv"}
    (results,) = proving.stored_results(tmp_path / "both", range(2)).values()
    assert [(r["truck"], r["failed"], len(r["logs"])) for r in results] == [(n, None, 2) for n in range(2)]


def test_unknown_workflows_and_foreign_folders_are_refused(tmp_path):
    with pytest.raises(ParameterError, match="did you mean 'paper'"):
        workflow("papper")
    with pytest.raises(ParameterError, match="MODULE:FUNCTION"):
        workflow("no_such_module:run")
    with pytest.raises(ParameterError, match="at least 1"):
        proving.prove("paper", [0], tmp_path, place=Workers(0))
    (tmp_path / "paper").mkdir()
    (tmp_path / "paper" / "settings.json").write_text('{"clutchid": "0.0", "source": "other"}')
    with pytest.raises(ExportError, match="another version or fleet"):
        proving.prove("paper", [0], tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="cannot be created"):
        proving.prove("paper", [0], tmp_path / "file")


@pytest.mark.parametrize(
    ("name", "methods"),
    [("calibrated", ["shooting"] * 2), ("calibrated-prediction-error", ["prediction-error"] * 2)],
)
def test_a_workflow_calibrates_and_adapts_by_its_method(ground, monkeypatch, name, methods):
    asked = []
    once = SimpleNamespace(actuator=None, calibration=None)
    monkeypatch.setattr(workflows, "fit", lambda *a, method=None, **k: asked.append(method) or once)
    monkeypatch.setattr(workflows, "_answer", lambda result, log: None)
    workflow(name)(ground.calibration.log, [ground.worn[0].log])
    assert asked == methods


def test_the_table_has_medians_worst_cases_and_ratios():
    def result(number, touch):
        scores = {"load": 1.0, "load_touch": touch, "half_load": -0.1, "pressure": 5.0, "coverage": 0.9}
        about = {"truck": number, "family": "A", "change": "none"}
        return {**about, "failed": None, "seconds": 2.0, "logs": {"worn1": {"score": scores, "wear_m": 1e-3}}}

    table = standings({"paper": [result(0, 8.0), result(1, 12.0)], "mine": [result(0, 1.0), result(1, 4.0)]})
    assert table.column("load_touch median") == (10.0, 2.5)
    assert table.column("load_touch worst") == (12.0, 4.0)
    assert table.column("half_load worst") == (0.1, 0.1)
    assert table.column("ratio") == (1.0, 0.25)
    assert scores.TOUCH == (5e-3, 8e-3)


def test_the_printed_table_fits_in_80_columns():
    scores = {"load": 11.76, "load_touch": 130.26, "half_load": -2.928, "pressure": 156.8, "coverage": 0.9}
    every = {"truck": 0, "family": "B", "change": "supply + cold + valves + seals", "failed": None, "seconds": 1234.5}
    result_of_truck = {**every, "logs": {"worn1": {"score": scores, "wear_m": 1e-3}}}
    results = {
        "paper": [result_of_truck],
        "paper-every-200-q@B+supply": [result_of_truck],
        "calibrated-known-phase": [result_of_truck],
    }
    table = standings(results)
    text = to_text(table, 80)
    assert max(map(len, text.splitlines())) <= 80
    numbers = [column.shown(table.column(column.name)[0]) for column in table.columns[5:]]
    assert all(number in text for number in numbers)


def test_a_proof_of_the_other_family_under_a_change_has_a_folder_and_a_row_of_its_own(short, tmp_path, monkeypatch):
    (tmp_path / "another_quick_workflow.py").write_text(QUICK)
    monkeypatch.syspath_prepend(tmp_path)
    name, out = "another_quick_workflow:run", tmp_path / "out"
    both = proving.Conditions("B", ("cold", "valves"))
    with without_workers():
        proving.prove(name, [4], out)
        (result,) = proving.prove(name, [4], out, both)
    assert (result["family"], result["change"], result["failed"]) == ("B", "cold + valves", None)
    results = proving.stored_results(out, [4])
    assert list(results) == ["another_quick_workflow_run", "another_quick_workflow_run@B+cold+valves"]
    table = standings(results)
    assert table.column("workflow") == ("another_quick_workflow_run",) * 2
    assert table.column("family") == ("A", "B")
    assert table.column("change") == ("none", "cold + valves")
    assert every_recording(results).column("family") == ("A", "A", "B", "B")


def test_the_calibration_is_unchanged_and_the_worn_recordings_are_changed_all_together(short):
    plain, cold = proving.proof(5), proving.proof(5, proving.Conditions(changes=("cold", "supply")))
    assert np.array_equal(plain.calibration.log["position"], cold.calibration.log["position"])
    for before, after in zip(plain.worn, cold.worn, strict=True):
        assert pytest.approx(before.truth.truck.T_0 - 30) == after.truth.truck.T_0
        assert pytest.approx(0.95 * before.truth.truck.P_S) == after.truth.truck.P_S
        assert after.truth.truck.wear == before.truth.truck.wear
        assert np.array_equal(after.truth.load(GRID), before.truth.load(GRID))


def test_an_unknown_family_or_change_ends_before_anything_runs(tmp_path):
    for family, change, words in (("C", "cold", "must be A or B"), ("A", "colt", "did you mean 'cold'")):
        with pytest.raises(ParameterError, match=words):
            proving.prove("paper", [0], tmp_path / "out", proving.Conditions(family, (change,)))
    assert not (tmp_path / "out").exists()


def test_the_command_proves_the_other_family_under_changes(short, tmp_path, monkeypatch, capsys):
    (tmp_path / "third_quick_workflow.py").write_text(QUICK)
    monkeypatch.syspath_prepend(tmp_path)
    chosen = {"trucks": 1, "workflow": "third_quick_workflow:run"}
    with without_workers():
        assert command(out=tmp_path / "out", family="B", change=["warm", "supply"], **chosen) == 0
    (row,) = (tmp_path / "out" / "standings.csv").read_text().splitlines()[1:]
    assert row.startswith("third_quick_workflow_run,B,warm + supply,1,0,")
    capsys.readouterr()
    assert command(out=tmp_path / "out", change=["hot"], **chosen) == 2
    assert capsys.readouterr().err.count("\n") == 1
