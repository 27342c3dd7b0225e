"""The page about Python: its examples print what it says."""

import doctest
import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"


def test_the_examples_of_the_page_about_python_print_what_it_says(tmp_path, monkeypatch):
    examples = "".join(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL))
    monkeypatch.chdir(tmp_path)
    found = doctest.DocTestRunner().run(doctest.DocTestParser().get_doctest(examples, {}, PAGE.name, str(PAGE), 1))
    assert found.attempted > 10
    assert found.failed == 0
    assert {path.name for path in tmp_path.iterdir()} == {"page.html", "load.pdf", "worn.csv"}
