"""Requirements of an export: each has its check and its code, and every page shows the same list."""

import re
import subprocess
from pathlib import Path

import pytest

from clutchid.exports.c99 import CStyle
from clutchid.exports.requirements import REQUIREMENTS, requirement_files
from clutchid.model import Actuator
from clutchid.observer import observer
from fixtures.export_c import write_sources
from fixtures.programs import path_of

PAGE = Path(__file__).parents[2] / "docs" / "assumptions.md"


def test_every_requirement_has_its_check_and_its_code_and_the_page_shows_them(tmp_path):
    observed, style = observer(Actuator()), CStyle(rates="two")
    checks = requirement_files(observed, style)["test/requirements.c"]
    assert re.findall(r'\{ "(R\d+)", r(\d+) \}', checks) == [(number, number[1:]) for number in REQUIREMENTS]
    write_sources(observed, style, tmp_path / "src")
    source = (tmp_path / "src" / "clutch.c").read_text()
    functions = " ".join(row.code for row in REQUIREMENTS.values()).replace("NAME", "clutch").split()
    assert [code for code in functions if not re.search(rf"^\w[\w *]*\b{code}\(.*\)$", source, re.MULTILINE)] == []
    assert "<!-- printed requirements -->" in PAGE.read_text()


def program(folder: Path, style: CStyle, change=lambda path, text: text, method="joint") -> subprocess.CompletedProcess:
    """The checks of an export, some of whose files may be changed."""
    observed = observer(Actuator(model="isothermal") if method == "paper" else Actuator(), method)
    write_sources(observed, style, folder / "src")
    (folder / "test").mkdir()
    for path, text in requirement_files(observed, style).items():
        (folder / path).write_text(text)
    for file in (folder / "src").iterdir():
        file.write_text(change(file.name, file.read_text()))
    sources = [folder / "test" / "requirements.c", *sorted((folder / "src").glob("*.c"))]
    command = [path_of("cc"), "-std=c99", "-O1", f"-I{folder / 'src'}", "-o", folder / "checks", *sources, "-lm"]
    subprocess.run(command, check=True)
    return subprocess.run([folder / "checks"], capture_output=True, text=True, check=False)


@pytest.mark.needs("cc")
@pytest.mark.slow
@pytest.mark.parametrize("method", ["states", "paper"])
def test_every_method_keeps_them(method, tmp_path):
    run = program(tmp_path, CStyle("unit", "float", "two"), method=method)
    assert run.stdout.startswith("requirements: ok")
    assert run.returncode == 0


@pytest.mark.needs("cc")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "instead", "number"),
    [
        ("(intake->undriven <= 20000u)", "(intake->undriven <= 2000u)", "R3"),
        ("(newest >= 0) ? (blocks[newest].counter + 1u) : 1u", "1u", "R8"),
        ("&blocks[(newest == 0) ? 1 : 0]", "&blocks[0]", "R8"),
        ("rule_count_anew(watch, (((double)(periods * 16000000u)) * 1e-06));", "", "R14"),
    ],
)
def test_a_promise_that_is_broken_is_named_by_its_number(text, instead, number, tmp_path):
    def change(name: str, source: str) -> str:
        assert name != "unit.c" or text in source
        return source.replace(text, instead) if name == "unit.c" else source

    run = program(tmp_path, CStyle("unit", "double"), change)
    assert run.stdout.startswith(f"{number}: failed, requirements.c:")
    assert run.returncode == 1
