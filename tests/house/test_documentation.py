"""What the documentation says is what the code does."""

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_of_equations_is_the_one_that_the_code_makes():
    spec = importlib.util.spec_from_file_location("make_equations", ROOT / "docs" / "make_equations.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (ROOT / "docs" / "equations.md").read_text(encoding="utf-8") == module.page()


def test_the_python_example_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    example = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL).group(1)
    assert len(example.strip().splitlines()) <= 14  # "a 12-line Python example" and two blank lines at most
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    assert "theta_1" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"simulated.parquet", "fit.toml"}


def test_every_local_link_in_the_documentation_leads_somewhere():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8"))]
    assert [f"{page.name}: {link}" for page, link in links if not (page.parent / link).exists()] == []


def test_the_readme_names_every_verb_of_the_command_line():
    verbs = {path.stem for path in (ROOT / "src" / "clutchid" / "cli").glob("*.py")} - {"__init__", "common"}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert {verb for verb in verbs if f"clutchid {verb}" not in readme} == set()
