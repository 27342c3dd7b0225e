"""A new parameter of the built-in equations is its row and its equation; all else follows."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fixtures.commands import keep_machine_code

pytestmark = pytest.mark.slow  # a variant is compiled anew

ROOT = Path(__file__).resolve().parents[2]

#: A friction that grows with the square of the velocity, and with cold grease: file, text in it, text in its place.
CHANGES = (
    (
        "parameters.py",
        "    # fmt: on\n",
        '    D_q: float = _magnitude(\n        2e4, "N·s²/m²", "quadratic friction", 0, 1e8,\n'
        "        share=0.3, drift=Drift(0.04), freed=Freed(), adapts=Adapting(std=0.2),\n"
        '        changes=(GroupChange("temperature and grease", -0.4, "warmer"),),\n    )\n    # fmt: on\n',
    ),
    (
        "model/assembly.py",
        '*b.all("D_v", "K_z", "D_zdot")))\n',
        '*b.all("D_v", "K_z", "D_zdot")) + b["D_q"] * v * sp.Abs(v))\n',
    ),
)

#: What the package of another process says of it.
QUESTIONS = """
import json, sys
import numpy as np
from printed import parameters, priors
from clutchid import Actuator, Log, read_parameters, simulate
from clutchid.estimation.automatic import freed
from clutchid.observer.methods import METHODS
from clutchid.observer.prior import online_prior
from clutchid.inference.uncertainty.change_prior import change_covariance, changeable
from clutchid.inference.uncertainty.calibration import consider_parameters
from clutchid.inference.uncertainty.coordinates import coordinates

actuator = Actuator(model="isothermal")
names = ("T_0", "D_q")
adapting = METHODS["joint"].adapting(actuator)
changed = change_covariance(actuator, names, ("temperature and grease",))
considered, root = consider_parameters(actuator, (), None)
t = np.arange(0.0, 0.3, 1e-3)
pulse = Log(t, {"duty_supply": 1.0 * (t > 0.05), "duty_exhaust": 0.0 * t})
with open("new.toml", "w") as file:
    file.write("[parameters]\\nD_q = 3e4\\n")
json.dump({
    "acts": "D_q" in actuator.acting,
    "width": coordinates(actuator, ["D_q"], {}, {})[0].width,
    "freed": freed(actuator)[-1],
    "changeable": changeable(actuator)[-1],
    "drift": {c.base: c.width for c in considered}["D_q"],
    "correlation": float(changed[0, 1] / np.sqrt(changed[0, 0] * changed[1, 1])),
    "adapting": adapting[-1],
    "hours": {c.base: c.width for c in online_prior(actuator, adapting).free}["D_q"],
    "page": [line for text in (parameters(), priors()) for line in text.splitlines() if line.startswith("| `D_q`")],
    "file": read_parameters("new.toml").actuator.value("D_q"),
    "slower": [float(simulate(actuator.replace({"D_q": d}), pulse).log["velocity"].max()) for d in (0.0, 2e4)],
}, sys.stdout)
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Answers of a copy of the package with the parameter."""
    folder = tmp_path_factory.mktemp("package")
    shutil.copytree(ROOT / "src" / "clutchid", folder / "clutchid", ignore=shutil.ignore_patterns("__pycache__"))
    for name, before, after in CHANGES:
        path = folder / "clutchid" / name
        text = path.read_text(encoding="utf-8")
        assert text.count(before) == 1
        path.write_text(text.replace(before, after), encoding="utf-8")
    keep_machine_code(folder / "cache")
    paths = os.pathsep.join([str(folder), str(ROOT / "docs")])
    process = subprocess.run(
        [sys.executable, "-c", QUESTIONS],
        env={**os.environ, "PYTHONPATH": paths, "CLUTCHID_CACHE": str(folder / "cache")},
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


def test_a_new_parameter_acts_is_read_printed_and_freed_drifts_changes_with_its_group_and_adapts(answers):
    # a warmer chamber: the air by 8.5 % and the drift of 0.2 %, the friction by -40 % and its drift of 4 %
    drift = (1 + (0.002 / 0.085) ** 2) * (1 + (0.04 / 0.4) ** 2)
    free, adapted = answers.pop("slower")
    assert adapted < 0.95 * free
    assert answers.pop("page") == [
        "| `D_q` | 20000 | N·s²/m² | quadratic friction | 0 to 1e+08 | Appendix A |",
        "| `D_q` | 30 % | 4 % | temperature and grease -40 % | yes | 20 % |",
    ]
    assert {answers.pop(name) for name in ("freed", "changeable", "adapting")} == {"D_q"}
    expected = {
        "acts": True,
        "file": 3e4,
        "width": 0.3,
        "drift": 0.04 * 2e4,
        "hours": 0.2,
        "correlation": -(drift**-0.5),
    }
    assert answers == pytest.approx(expected)
