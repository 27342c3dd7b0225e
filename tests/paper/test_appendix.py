"""Appendix A, typed again from the page, row by row."""

import pytest

from clutchid.model import Actuator
from clutchid.parameters import Parameters
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_appendix")

# printed name, ours, value, unit, a word of the printed description
ROWS = CASES["rows"]


@pytest.mark.parametrize(("printed", "name", "value", "unit", "word"), ROWS, ids=[row[0] for row in ROWS])
def test_a_row_of_the_appendix_stands_in_the_parameters(printed, name, value, unit, word):
    row = Parameters.row(name)
    assert getattr(Parameters(), name) == value
    assert row.unit == unit
    assert word in row.meaning
    assert row.source == "Appendix A"
    assert row.admits(value)


def test_the_appendix_has_twenty_five_rows_and_they_come_first_in_its_order():
    assert [name for _, name, *_ in ROWS] == list(Parameters.names()[:25])


def test_what_the_paper_does_not_print_says_where_it_comes_from():
    others = Parameters.names()[25:]
    assert others[:6] == ("rho_0", "y_max", "r_lam", "K_stop", "D_stop", "d_stop")
    assert all(Parameters.row(name).source != "Appendix A" for name in others)
    assert all("docs/" in Parameters.row(name).source for name in others[6:])


def test_the_operation_range_of_section_3_1_is_the_stroke():
    assert Parameters().y_max == 25e-3
    assert "Section 3.1" in Parameters.row("y_max").source


def test_the_actuator_of_the_paper_is_what_an_actuator_is_without_arguments():
    assert Actuator().parameters == Parameters()
