"""Errors: named by what the caller must mend, each also a built-in."""

import pytest

from clutchid.errors import ClutchidError, DataError, ExportError, MissingExtra, ParameterError, SolveError

BUILT_IN = {
    ParameterError: ValueError,
    DataError: ValueError,
    SolveError: ArithmeticError,
    ExportError: OSError,
    MissingExtra: ImportError,
}


@pytest.mark.parametrize("error", BUILT_IN)
def test_an_error_is_ours_and_a_built_in(error):
    assert issubclass(error, ClutchidError)
    assert issubclass(error, BUILT_IN[error])


def test_one_problem_stands_in_the_sentence_and_several_stand_below_it():
    assert str(DataError.of("a.csv", ["no unit."])) == "a.csv: no unit."
    assert str(DataError.of("a.csv", ["no unit.", "a gap."])) == "a.csv: 2 problems.\n  - no unit.\n  - a gap."
