"""What must not be in the repository: paths of somebody's machine, addresses in the pins, hidden skips."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = {".py", ".j2", ".toml", ".md", ".txt", ".cfg", ".yml", ".yaml", ".json", ".sh", ".html", ".css", ".rst", ""}
SKIPPED = {".git", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", "__pycache__"}
SKIPPED |= {".venv", "venv", "build", "dist"}


def texts() -> list[Path]:
    return [
        path
        for path in ROOT.rglob("*")
        if path.is_file() and path.suffix in TEXT and not _skipped(path.relative_to(ROOT).parts)
    ]


def _skipped(parts: tuple[str, ...]) -> bool:
    return any(part in SKIPPED or part.startswith(".venv") for part in parts)


def test_no_file_names_a_folder_of_somebodys_machine():
    # written in pieces, because this file is looked at too
    folders = ["/" + "work/", "/" + "root/", "/" + "home/[a-z]", "/" + "Users/[A-Za-z]", "/" + "tmp/w/"]
    own = re.compile("|".join(folders))
    lines = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}"
        for path in texts()
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
        if own.search(line)
    ]
    assert lines == []


def test_the_pins_are_names_and_numbers_only():
    pins = ROOT / "constraints.txt"
    if not pins.exists():
        pytest.skip("no constraints.txt yet")
    lines = [line for line in pins.read_text().splitlines() if line.strip() and not line.startswith("#")]
    assert [line for line in lines if not re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!_-]+", line.strip())] == []


def test_every_skip_and_expected_failure_says_why():
    bare = []
    for path in (ROOT / "tests").rglob("*.py"):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if re.search(r"(pytest\.skip|mark\.skip|mark\.xfail)\s*(\(\s*\))?\s*$", line):
                bare.append(f"{path.relative_to(ROOT)}:{number}")
    assert bare == []


def test_names_of_tests_are_sentences():
    names = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^\s*def (test_\w+)\(", path.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert [name for name in names if name.rpartition("test_")[2].count("_") < 2] == []


@pytest.mark.slow
def test_no_files_import_each_other_in_a_loop(source):
    house = runpy.run_path(str(ROOT / "benchmarks" / "house.py"))
    assert house["circles"](source.parent) == []


def test_no_room_is_larger_than_its_limit():
    house = runpy.run_path(str(ROOT / "benchmarks" / "house.py"))
    assert house["over"](house["sizes"](ROOT), house["limits_of"](ROOT)) == []


def test_a_room_beyond_its_limit_or_without_one_is_named():
    house = runpy.run_path(str(ROOT / "benchmarks" / "house.py"))
    assert house["over"]({"wear": 912, "rig": 700, "attic": 5}, {"wear": 900, "rig": 700}) == [
        "wear: 912 is 12 over its limit of 900",
        "attic: 5 has no limit in [tool.house]",
    ]


def test_a_loop_of_imports_is_found(tmp_path):
    house = runpy.run_path(str(ROOT / "benchmarks" / "house.py"))
    package = tmp_path / "clutchid"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "one.py").write_text("from clutchid import two\n")
    (package / "two.py").write_text("def f():\n    from clutchid.three import x\n")
    (package / "three.py").write_text("from clutchid.one import two as x\n")
    (package / "four.py").write_text("if TYPE_CHECKING:\n    from clutchid.five import y\n")
    (package / "five.py").write_text("from clutchid.four import z\n")
    assert [sorted(loop) for loop in house["circles"](tmp_path)] == [["clutchid.one", "clutchid.three", "clutchid.two"]]
