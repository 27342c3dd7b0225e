"""``clutchid export``: files, parity, and one sentence for bad input."""

import json
import re

import pytest

from clutchid.exports.exporting import BY_EXPORT, BY_ROUNDING, NO_POSITION_ONLY
from clutchid.exports.frames import results_dbc
from clutchid.exports.parity import Parity
from clutchid.observer.health import FLAGS
from fixtures.commands import called

pytestmark = pytest.mark.slow


def exported(folder, tmp_path, *options):
    return called("export", folder / "cal.toml", "--out", tmp_path / "observer", *options)


@pytest.mark.needs("cc")
def test_it_writes_the_observer_and_says_that_c_and_python_are_alike(folder, tmp_path, capsys):
    assert exported(folder, tmp_path, "--check", folder / "worn.parquet", folder / "first.parquet") == 0
    said, errors = capsys.readouterr()
    assert " ".join(errors.split()) == f"warning: {NO_POSITION_ONLY}"
    assert re.match(r"the C agrees with Python on worn, first, 8\d{3} samples: load ", said)
    names = {path.relative_to(tmp_path / "observer").as_posix() for path in (tmp_path / "observer").rglob("*.*")}
    modules = {f"src/clutch{part}{suffix}" for part in ("", "_model", "_filter", "_data") for suffix in (".h", ".c")}
    assert modules | {"README.md", "PARITY.md", "test/replay.c"} <= names
    page = (tmp_path / "observer" / "PARITY.md").read_text()
    assert re.findall(r"^## (.*)$", page, re.MULTILINE) == ["worn", "first"]
    assert page.count("**the C agrees with Python**") == 2
    assert page.count("Samples by flag are the same.") == 2
    advice = (tmp_path / "observer" / "README.md").read_text().partition("## What to do at a flag")[2]
    assert all(f"`{flag}`" in advice for flag in FLAGS)


@pytest.mark.needs("cc")
def test_json_has_files_and_differences_of_an_export_that_goes_on_from_a_saved_state(folder, tmp_path, capsys, observe):
    assert observe(folder / "first.parquet", "--save", "state.toml")[0] == 0
    options = ("--real", "double", "--name", "own", "--rates", "two", "--resume", tmp_path / "state.toml")
    options = (*options, "--supply-std", "0.03", "--supply-sensor-std", "0.025")
    assert exported(folder, tmp_path, "--json", *options) == 0
    assert ".strokes = 0u" not in (tmp_path / "observer" / "src" / "own_data.c").read_text()
    content = json.loads(capsys.readouterr().out)
    assert content["status"] == "ok"
    assert "src/own.c" in content["files"]
    assert content["parity"]["holds"] is True
    assert content["parity"]["load"] < 1e-6
    assert content["parities"] == [content["parity"]]


@pytest.mark.needs("cc")
@pytest.mark.parametrize(("in_double", "note"), [(True, BY_ROUNDING), (False, BY_EXPORT)], ids=["rounding", "an error"])
def test_a_recording_on_which_they_are_not_alike_is_named(folder, tmp_path, capsys, monkeypatch, in_double, note):
    # the second recording misses the bounds in float
    monkeypatch.setattr(
        Parity, "holds", lambda parity, style: parity.recording == "first" or (style.real == "double" and in_double)
    )
    assert exported(folder, tmp_path, "--json", "--check", folder / "first.parquet", folder / "worn.parquet") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["status"] == "warning"
    assert content["message"].startswith("the C does not agree with Python on worn, 6000 samples: ")
    assert note in content["warnings"]
    assert [(entry["recording"], entry["holds"]) for entry in content["parities"]] == [("first", True), ("worn", False)]
    assert content["parity"] == content["parities"][1]
    page = (tmp_path / "observer" / "PARITY.md").read_text().partition("## worn")
    assert note in page[0]
    assert "**the C agrees with Python**" in page[0]
    assert "**the C does not agree with Python**" in page[2]


def test_without_a_compiler_the_files_are_there_and_parity_was_not_run(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("clutchid.exports.c99.shutil.which", lambda *_, **__: None)
    monkeypatch.setattr("clutchid.exports.fmu.find_spec", lambda _: None)
    assert exported(folder, tmp_path, "--to", "c,fmu2,fmu3", "--model") == 0
    said, errors = capsys.readouterr()
    assert "parity was not run: there is no C compiler (cc)" in errors
    assert "exported" in said
    assert (tmp_path / "observer" / "src" / "clutch.c").exists()
    names = ("clutch", "clutch_fmi3", "clutch_model", "clutch_model_fmi3")
    assert {f"{name}.fmu" for name in names} == {file.name for file in (tmp_path / "observer" / "fmu").iterdir()}
    for name in names:
        assert f"fmu/{name}.fmu has no binary for 64-bit Linux: there is no C compiler" in " ".join(errors.split())
        assert f"fmu/{name}.fmu has no binary for 64-bit Windows: ziglang" in " ".join(errors.split())


def test_the_dbc_of_results_is_beside_it(folder, tmp_path):
    assert exported(folder, tmp_path, "--to", "c,dbc") == 0
    assert (tmp_path / "observer" / "dbc" / "clutch.dbc").read_text() == results_dbc()


def test_a_folder_that_cannot_be_made_is_a_sentence(folder, tmp_path, capsys):
    (tmp_path / "observer").touch()
    assert exported(folder, tmp_path) == 2
    assert "the folder cannot be created (Not a directory)" in " ".join(capsys.readouterr().err.split())
