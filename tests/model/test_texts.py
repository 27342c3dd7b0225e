"""Texts of the standard models in the wheel."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import clutchid
from clutchid.codegen import cache
from clutchid.codegen.kernels import LANES
from clutchid.model import compiled
from clutchid.model.variants import VARIANTS
from fixtures.commands import keep_machine_code

RECORDING = Path(clutchid.__file__).parent / "study/data/truck1_calibration.csv"

FIT = """
import sys
from pathlib import Path
from clutchid.codegen import cache
from clutchid.codegen.kernels import LANES

cache.TEXTS = Path(sys.argv[1])
sys.argv = ["clutchid", "fit", sys.argv[2]]
from clutchid.__main__ import main

try:
    main()
finally:
    assert "numba" in sys.modules
    assert "sympy" not in sys.modules
"""


@pytest.mark.slow
def test_the_first_fit_with_the_texts_of_the_wheel_imports_no_sympy(tmp_path):
    keep_machine_code(tmp_path / "cache")
    text = compiled._kernels_text("isothermal")
    cache.keep_text(tmp_path / "texts", "isothermal", compiled._sources(), text)
    cache.keep_text(tmp_path / "texts", "functions", compiled._sources(), compiled._functions_text())
    recording = tmp_path / "first.csv"
    recording.write_text("".join(RECORDING.read_text().splitlines(keepends=True)[:3000]))
    subprocess.run(
        [sys.executable, "-c", FIT, tmp_path / "texts", recording], check=True, capture_output=True,
        env={**os.environ, "CLUTCHID_CACHE": str(tmp_path / "cache")},
    )  # fmt: skip
    (module,) = (tmp_path / "cache").rglob("isothermal.py")
    assert module.read_text().partition("\n")[2] == text


def test_the_wheel_has_the_text_of_every_variant_and_of_the_functions(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "_kernels_text", lambda model: f"# {model}\n")
    monkeypatch.setattr(compiled, "_functions_text", lambda: "# functions\n")
    monkeypatch.setattr(compiled, "_lanes_text", lambda model, count: f"# {model}, {count} lanes\n")
    paths = compiled.write_texts(tmp_path / "texts")
    monkeypatch.setattr(cache, "TEXTS", tmp_path / "texts")
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "cache"))
    for variant in VARIANTS:
        name = variant.replace("-", "_")
        module = cache.load_module(name, compiled._sources(), lambda: pytest.fail("built"))
        assert Path(module.__file__).read_text().endswith(f"# {variant}\n")
    names = [variant.replace("-", "_") for variant in VARIANTS]
    assert {path.name.rpartition("-")[0] for path in paths} == {
        "functions", *names, *(f"{name}_{count}_lanes" for name in names for count in LANES)
    }  # fmt: skip


def test_the_wheel_is_made_with_the_sympy_that_constraints_name():
    root = Path(__file__).parents[2]
    pinned = next(line for line in (root / "constraints.txt").read_text().splitlines() if line.startswith("sympy=="))
    assert f'"{pinned}"' in (root / "pyproject.toml").read_text()
