"""The pages with Python: their examples print what they say."""

import doctest
import re
from pathlib import Path

import pytest

from fixtures.cases import case_tables
from fixtures.commands import without_workers
from fixtures.once import fits_once

CASES = case_tables(__file__, "test_python_page")

DOCS = Path(__file__).resolve().parents[2] / "docs"

#: The files that each page writes.
WRITTEN = {
    "python.md": {"page.html", "load.pdf", "worn.csv", "state.toml", "cal.toml", "trucks", "result"},
    "excitation.md": set(),
    "from_matlab.md": {"run.csv", "load.mat", "simulated.mat"},
    "calibrate_read_compare.md": {"cal.toml"},
}

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")


class TwoDigits(doctest.OutputChecker):
    """Compares numbers to two digits, for another machine rounds differently; everything else as it is."""

    def check_output(self, want, got, flags):
        if super().check_output(want, got, flags):
            return True
        pairs = [*zip(want.splitlines(), got.splitlines(), strict=False)]
        return len(want.splitlines()) == len(got.splitlines()) and all(self._alike(*pair, flags) for pair in pairs)

    def _alike(self, want, got, flags):
        shown, printed = _NUMBER.findall(want), _NUMBER.findall(got)
        if len(shown) != len(printed):
            return super().check_output(want, got, flags)
        return super().check_output(_NUMBER.sub("#", want), _NUMBER.sub("#", got), flags) and all(
            map(near, shown, printed)
        )


def near(shown, printed):
    """Whether two numbers agree to two digits, or but for one in the last digit shown."""
    mantissa, _, exponent = shown.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= max(0.02 * abs(float(shown)), 1.001 * last)


@pytest.mark.slow
@fits_once()
@without_workers()
@pytest.mark.parametrize("name", WRITTEN)
def test_the_examples_of_a_page_print_what_it_says(blank, name, tmp_path, monkeypatch):
    page = DOCS / name
    examples = "".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner(TwoDigits(), optionflags=doctest.ELLIPSIS)
    outcome = runner.run(doctest.DocTestParser().get_doctest(examples, {}, name, str(page), 1))
    assert outcome.attempted > 5
    assert outcome.failed == 0
    assert {path.name for path in tmp_path.iterdir()} == WRITTEN[name]


@pytest.mark.parametrize(("shown", "printed", "same"), CASES["numbers"])
def test_numbers_of_a_page_are_compared_to_two_digits_and_words_exactly(shown, printed, same):
    assert TwoDigits().check_output(shown, printed, doctest.ELLIPSIS) == same
