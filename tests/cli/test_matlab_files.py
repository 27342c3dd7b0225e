"""``clutchid fit --save`` beside TOML: files for MATLAB, and one sentence for a name that is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from clutchid import truck as virtual
from clutchid.estimation.parameter_file import read_parameters
from clutchid.recordings import write
from fixtures.commands import called
from fixtures.matlab_text import struct_in


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four seconds of a virtual truck."""
    path = tmp_path_factory.mktemp("matlab") / "strokes.csv"
    write(virtual.drive(virtual.truck(1), manoeuvre="strokes", seconds=4, seed=1, pressure=False).log, path)
    return path


def test_files_for_matlab_have_the_values_of_the_parameter_file_to_the_last_bit(
    recording: Path, tmp_path: Path
) -> None:
    for suffix in (".toml", ".mat", ".m"):
        assert called("fit", recording, "--save", tmp_path / f"fit{suffix}") == 0
    saved = read_parameters(tmp_path / "fit.toml")
    for found in (
        loadmat(tmp_path / "fit.mat", simplify_cells=True)["clutchid"],
        struct_in((tmp_path / "fit.m").read_text(encoding="ascii")),
    ):
        values = {name: entry["value"] for name, entry in found["parameters"].items()}
        assert values == {name: saved.actuator.value(name) for name in saved.actuator.names}
        stds = {name: found["parameters"][name]["std"] for name in saved.fit["free"]}
        assert stds == saved.fit["std"]
        (entry,) = np.atleast_1d(found["recordings"])
        assert {entry["name"]: entry["sha256"]} == saved.fit["data"]
        ((position, pressure),) = saved.starts["strokes"]
        assert np.atleast_1d(entry["position_start_m"]) == [position]
        assert np.atleast_1d(entry["pressure_a_start_Pa"]) == [pressure]


@pytest.mark.parametrize(
    ("option", "name", "sentence"),
    [
        (
            "--save",
            "fit.json",
            "the suffix '.json' is not known; a fit is saved as .toml, for --start and simulate, or",
        ),
        ("--save", "fit-1.m", "MATLAB has no function files with such a name; name it fit_1.m."),
        ("--start", "fit.mat", "is for MATLAB, and clutchid does not read it back; save the fit as .toml too"),
    ],
)
def test_a_name_that_cannot_be_used_is_bad_input_before_anything_is_read(
    option: str, name: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called("fit", tmp_path / "no_such_recording.csv", option, tmp_path / name) == 2
    error = capsys.readouterr().err
    assert f"{name}: {sentence}" in error
    assert len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())
