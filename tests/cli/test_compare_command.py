"""``clutchid compare``: loads of saved fits side by side, as they were fitted."""

import json
from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents.fit_json import curve_json
from clutchid.estimation.parameter_file import read_parameters, write_parameters
from clutchid.verbs.saving import parameter_file


@pytest.fixture
def saved(fitted, tmp_path):
    """A fit that was saved, and one with half of its load."""
    curve = fitted.load_curve
    half = replace(curve, force=curve.force / 2, low=curve.low / 2, high=curve.high / 2)
    for name, fit in (("new", fitted), ("worn", replace(fitted, load_curve=half))):
        write_parameters(parameter_file(fit), tmp_path / f"{name}.toml")
    return tmp_path


def test_saved_loads_are_as_they_were_fitted_on_the_terminal_in_json_and_on_a_page(command, saved, fitted):
    process = command("compare", "new.toml", "worn.toml", "--json", cwd=saved)
    first, second = json.loads(process.stdout)["loads"]
    assert first["load_curve"] == json.loads(json.dumps(curve_json(fitted.load_curve)))
    np.testing.assert_allclose(second["load_curve"]["force_N"], fitted.load_curve.force / 2)
    assert first["reach_m"] == pytest.approx(max(r.measured.reach() for r in fitted.recordings.values()))
    said = command("compare", "new.toml", "worn.toml", "--report", "page.html", cwd=saved).stdout
    assert [name for name in ("5 mm", "new.toml", "worn.toml", " ± ", "written: ") if name not in said] == []
    page = (saved / "page.html").read_text(encoding="utf-8")
    assert "clutchid compare new.toml worn.toml --report page.html" in page


def test_a_file_without_a_load_and_a_load_that_is_none_are_refused(command, saved):
    content = read_parameters(saved / "new.toml")
    for name, load in (("none", None), ("short", {**content.fit["load"], "force": [1.0]})):
        about = {key: value for key, value in content.fit.items() if key != "load"} | ({"load": load} if load else {})
        write_parameters(replace(content, fit=about), saved / f"{name}.toml")
    for arguments, words in (
        (["none.toml"], "none.toml: is a parameter file without a fitted load"),
        (["short.toml"], "as many positions as forces are needed"),
        ([], "no file given; clutchid compare"),
        (["new.toml", "--report", "new.toml"], "is a file that is compared"),
    ):
        process = command("compare", *arguments, cwd=saved)
        assert (process.returncode, words in " ".join(process.stderr.split())) == (2, True), process.stderr
