"""Appendix A, typed again from the page, row by row."""

import pytest

from clutchid.model import Actuator
from clutchid.parameters import Parameters

# printed name, ours, value, unit, a word of the printed description
ROWS = [
    ("A_A", "A_A", 12.3e-3, "m²", "area"),
    ("A_B", "A_B", 11.848e-3, "m²", "area"),
    ("V_{0,A}", "V_0A", 0.148e-3, "m³", "volume"),
    ("V_{0,B}", "V_0B", 1.2e-4, "m³", "volume"),
    ("P_0", "P_0", 1.095e5, "Pa", "ambient pressure"),
    ("T_0", "T_0", 293, "K", "temperature"),
    ("R", "R", 288, "J/(kg·K)", "gas constant of air"),
    ("M", "M", 10, "kg", "mass of the piston"),
    ("P_S", "P_S", 9e5, "Pa", "supply pressure"),
    ("D_v", "D_v", 5000, "N·s/m", "viscous"),
    ("K_z", "K_z", 1e6, "N/m", "stiffness"),
    ("D_zdot", "D_zdot", 5000, "N·s/m", "damping"),
    ("F_C", "F_C", 200, "N", "Coulomb friction"),
    ("R_{0,vs}", "R_0vs", 0.07, "1", "supply valve"),
    ("R_{0,ve}", "R_0ve", 0.07, "1", "exhaust valve"),
    ("R_{1,vs}", "R_1vs", 0.93, "1", "supply valve"),
    ("R_{1,ve}", "R_1ve", 0.93, "1", "exhaust valve"),
    ("B_{vs}", "B_vs", 0.1, "1", "flow shape"),
    ("B_{ve}", "B_ve", -0.7, "1", "flow shape"),
    ("C_{vs}", "C_vs", 19e-9, "m³/(Pa·s)", "conductance"),
    ("C_{ve}", "C_ve", 21.4e-9, "m³/(Pa·s)", "conductance"),
    ("C_r", "C_r", 5e-8, "m³/(Pa·s)", "conductance"),
    ("B_0", "B_0", 0.582, "1", "critical"),
    ("B_{in}", "B_in", 0.5, "1", "flow shape"),
    ("B_{out}", "B_out", 0.5, "1", "flow shape"),
]


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
