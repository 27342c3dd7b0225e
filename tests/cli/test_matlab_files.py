"""``clutchid fit --save`` beside TOML: files for MATLAB, and one sentence for a name that is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from fixtures.commands import called


@pytest.mark.parametrize(
    ("option", "name", "sentence"),
    [
        ("--save", "fit.json", "the suffix '.json' is not known; a fit is saved as .toml, for --start and simulate"),
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
