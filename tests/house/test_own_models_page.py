"""The page about models of one's own: its file, its Python and its commands do what it says, in its order."""

import re
import shlex
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from unittest import mock

import pytest

from clutchid.estimation.parameter_file import read_parameters
from clutchid.model import own_model
from clutchid.model.own.units import TERM_UNITS
from fixtures.commands import called

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "own_models.md"
EXAMPLE = ROOT / "docs" / "examples" / "maxwell_slip.py"


def blocks() -> list[tuple[str, str]]:
    """Language and text of every block of the page."""
    return re.findall(r"```(\w+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def typed(line: str) -> subprocess.CompletedProcess[str]:
    """Call a command of the page in this process; a line of another program is run."""
    program, *words = shlex.split(line, comments=True)
    if program != "clutchid":
        return subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=600, check=False)
    said, errors = StringIO(), StringIO()
    with redirect_stdout(said), redirect_stderr(errors), mock.patch.object(sys, "argv", [program, *words]):
        code = called(*words)
    return subprocess.CompletedProcess(line, code, said.getvalue(), errors.getvalue())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which everything on the page has been done, and what each command printed."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "maxwell_slip.py").write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    last, answers = None, []
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for language, text in blocks():
            if language == "python":
                exec(compile(text, PAGE.name, "exec"), {})
            elif language == "sh":
                for line in text.strip().splitlines():
                    last = typed(line)
                    answers.append([line, last, ""])
            else:
                answers[-1][2] = text.strip()
    return folder, answers


def test_every_command_of_the_page_does_what_the_page_says(folder):
    _, answers = folder
    assert len(answers) == 6
    for line, process, expected in answers:
        assert process.returncode == (2 if expected else 0), (line, process.stderr)
        if expected:
            assert re.sub(r"'\w{12}…'", "'HASH…'", process.stderr.strip()) == expected


def test_the_calibration_of_the_page_finds_the_values_that_made_the_recording(folder):
    model = own_model(folder[0] / "maxwell_slip.py", "maxwell_slip")
    content = read_parameters(folder[0] / "CAL.toml", model)
    std = content.fit["std"]
    for name, value in {"F_1": 150, "F_2": 60, "k_vs": 1.5, "K_1": 8e5, "K_2": 2e5}.items():
        # four standard errors: a fifth parameter outside would be one seed in three thousand
        assert content.actuator.value(name) == pytest.approx(value, abs=4 * std[name])
        assert std[name] < model.parameters[name].std
    assert {"K_r", "D_z", "F_C", "K_z"} & set(std) == set()


def test_the_page_writes_c_and_the_own_states(folder):
    assert "maxwell_slip_step" in (folder[0] / "maxwell_slip.h").read_text()
    assert (folder[0] / "SIM.csv").read_text().splitlines()[0].endswith("z_1 [m],z_2 [m]")


def test_the_page_names_the_terms_that_can_be_replaced():
    rows = re.findall(r"^\| (`.*?) \| (\S+) \| ", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    named = {name: unit for names, unit in rows for name in re.findall(r"`(\w+)`", names) if name in TERM_UNITS}
    assert named == {name: TERM_UNITS[name] for name in named}
    carrier = {name for name in TERM_UNITS if re.fullmatch(r"[hqlcai]_v[se]1?|u_v[se]1?|[cd]_pwm|f_l", name)}
    assert set(named) | carrier == set(TERM_UNITS)
