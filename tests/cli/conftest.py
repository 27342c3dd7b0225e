"""A recording of a worn clutch that is observed in many ways, and what is observed in its file."""

import json
import subprocess

import polars as pl
import pytest

from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.measurements import write
from fixtures.commands import called
from fixtures.once import fits_once

#: Samples of the first part of the recording in two parts.
CUT = 2345


@pytest.fixture(scope="session")
def folder(tmp_path_factory, plant, recorded_by):
    """A calibration, a recording of a worn clutch in several formats, whole and in two parts, and its results."""
    made = tmp_path_factory.mktemp("observe")
    write_parameters(ParameterFile(plant), made / "cal.toml")
    worn = plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names})
    log = recorded_by(worn, seconds=6.0, name="worn")
    for name, part in (("worn", log), ("first", log.slice(0, CUT)), ("rest", log.slice(CUT, len(log)))):
        write(part, made / f"{name}.parquet")
    write(log, made / "worn.csv")
    rows = pl.read_csv(made / "worn.csv").iter_rows(named=True)
    (made / "worn.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (made / "file").mkdir()
    outputs = ("--out", made / "file" / "est.parquet", "--save", made / "file" / "state.toml")
    assert called("observe", made / "worn.csv", "--start", made / "cal.toml", *outputs) == 0
    return made


@pytest.fixture(scope="module", autouse=True)
def _fits():
    """Compute a fit of the same recordings once: no test of a command is about its numbers."""
    with fits_once():
        yield


@pytest.fixture(autouse=True)
def _blank(blank):
    """Leave figures empty: no test of a command looks at them."""


@pytest.fixture
def command(capsys, monkeypatch):
    """Call a command in this process, in a folder; its exit code and what it printed, as of a process of its own."""

    def run(*arguments, cwd=None):
        if cwd is not None:
            monkeypatch.chdir(cwd)
        capsys.readouterr()
        return subprocess.CompletedProcess(arguments, called(*arguments), *capsys.readouterr())

    return run


@pytest.fixture
def observe(folder, tmp_path, monkeypatch, capsys):
    """Observe in a folder of its own; exit code, output, and errors on one line."""
    monkeypatch.chdir(tmp_path)

    def run(log, *options, start=None, out="est.parquet"):
        code = called("observe", log, "--start", start or folder / "cal.toml", "--out", out, *options)
        said, errors = capsys.readouterr()
        return code, said, " ".join(errors.split())

    return run


@pytest.fixture
def same(folder, tmp_path):
    """Compare results, in parts or before so many samples, and a saved state with those of the whole file."""

    def check(*parts, rows=None):
        for suffix in (".parquet", ".load.parquet"):
            frames = [pl.read_parquet(tmp_path / f"{part}{suffix}") for part in parts or ("est",)]
            live, file = pl.concat(frames), pl.read_parquet(folder / "file" / f"est{suffix}")
            if rows is not None:
                live, file = (frame.filter(pl.col("time [s]") < rows / 1000) for frame in (live, file))
            assert live.equals(file, null_equal=True), suffix
        if rows is None and (tmp_path / "state.toml").exists():
            assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()

    return check
