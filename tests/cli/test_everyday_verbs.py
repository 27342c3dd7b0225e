"""``clutchid calibrate`` and ``clutchid estimate``: the fits of every day, with the other options of ``fit``."""

import json

import pytest

from clutchid import write
from clutchid.cli import app
from clutchid.truck import Truck, drive
from fixtures.commands import called

#: Options whose defaults are a verb's own.
OWN = {"--measure", "--free", "--start"}


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Run a command in a folder of its own; exit code, output and errors."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: (called(*arguments), *capsys.readouterr())


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Paths of a recording with pressure, and of one without."""
    folder = tmp_path_factory.mktemp("recordings")
    write(drive(Truck(), seconds=2.5, seed=1).log, folder / "cal.csv")
    write(drive(Truck(), seconds=2.5, seed=2, pressure=False).log, folder / "worn.csv")
    return str(folder / "cal.csv"), str(folder / "worn.csv")


def options(verb):
    """Names, help and default of all options of a verb but its own."""
    parsed = app()[verb].assemble_argument_collection(parse_docstring=True)
    of_verb = {
        entry.name: (entry.names, entry.parameter.help, entry.field_info.default) for entry in parsed if entry.names
    }
    return {name: rest for name, rest in of_verb.items() if name.startswith("--") and name not in OWN}


@pytest.mark.parametrize("verb", ["calibrate", "estimate"])
def test_a_verb_of_every_day_has_the_other_options_of_fit(verb):
    assert len(options(verb)) >= 20
    assert options(verb) == options("fit")
    assert all(help_ for _, help_, _ in options(verb).values())


def test_an_estimate_without_a_calibration_says_what_to_do(call, recordings):
    code, out, err = call("estimate", recordings[1])
    assert (code, out) == (2, "")
    assert err.startswith("clutchid: no --start: ")
    assert "clutchid estimate WORN.csv --start CAL.toml" in err
    assert "clutchid calibrate CAL.csv --save CAL.toml" in err
    code, out, _ = call("estimate", recordings[1], "--json")
    assert (code, json.loads(out)["status"]) == (2, "bad_input")


def test_a_result_is_saved_in_several_files(call, recordings, tmp_path):
    saves = ("--save", "fit.toml", "--save", "fit.mat")
    code, out, _ = call("fit", recordings[1], *saves)
    assert code == 0
    assert {path.name for path in tmp_path.iterdir()} == {"fit.toml", "fit.mat"}
    assert all(f"written: {tmp_path / name}" in out for name in ("fit.toml", "fit.mat"))


def test_values_of_the_paper_that_come_from_a_start_file_are_no_missing_option(call, recordings, tmp_path):
    (tmp_path / "start.toml").write_text("[model]\nload_basis = 'b-spline'\nknots = [0.0, 0.004, 0.01, 0.025]\n")
    code, out, _ = call("fit", recordings[1], "--start", "start.toml")
    assert code == 0
    assert "assumed  parameters not fitted are those of the paper's truck: no calibration" in out
    assert "no --start" not in out
