"""LaTeX in the letters of the paper."""

import importlib
import re
from pathlib import Path

import pytest
import sympy as sp

from clutchid.codegen.system import System, TabulatedFunction
from clutchid.model.isothermal import isothermal
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_latex")


@pytest.fixture(scope="module")
def latex():
    """The script that writes formulas of pages."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "docs"))
        yield importlib.import_module("latex")


@pytest.mark.parametrize(("name", "text"), CASES["names_are_written_as_in_the_paper"])
def test_names_are_written_as_in_the_paper(latex, name, text):
    assert latex.letters(name) == text


def test_positive_terms_come_first_and_conditions_become_cases(latex):
    w_ve, w_vs, x = sp.symbols("w_ve w_vs x", real=True)
    assert latex.expression_latex(w_vs - w_ve) == "w_{vs} - w_{ve}"
    cases = sp.Piecewise((x, x > 0), (0, True))
    assert latex.expression_latex(cases) == r"\begin{cases} x, & x > 0 \\ 0, & \text{otherwise} \end{cases}"


def test_a_system_is_one_aligned_block_with_definitions_then_derivatives(latex):
    x, a, d, f = sp.symbols("x a d f", real=True)
    inner = sp.Piecewise((x, x > 0), (0, True))
    text = latex.latex_source(System("s", (x,), (), (a,), ((d, a * (inner + 1)),), (d - f,), TabulatedFunction(f, x)))
    assert text == (
        "\\begin{aligned}\n"
        "d^{(1)} &= \\begin{cases} x, & x > 0 \\\\ 0, & \\text{otherwise} \\end{cases} \\\\\n"
        "d &= a \\left(d^{(1)} + 1\\right) \\\\\n"
        "f &= \\sum_i \\theta_i \\, \\phi_i(x) \\\\\n"
        "\\dot{x} &= d - f\n"
        "\\end{aligned}\n"
    )


def test_the_model_reads_as_in_the_paper(latex):
    text = latex.latex_source(isothermal())
    assert r"\dot{v} &= \frac{A_A p_A - A_B p_B - P_0 \left(A_A - A_B\right) - f_f - f_l - f_s}{M}" in text
    assert r"f_f &= D_v v + D_{\dot{z}} \dot{z} + K_z z" in text
    assert text.count(r"\dot{z} &=") == 1  # defined as such, so not repeated as the derivative of z


def test_braces_and_environments_are_balanced(latex):
    text = latex.latex_source(isothermal())
    assert text.count("{") == text.count("}")
    assert text.count(r"\left(") == text.count(r"\right)")
    assert text.count(r"\begin{cases}") == text.count(r"\end{cases}") > 5
    assert "Piecewise" not in text
    assert "_" not in re.sub(r"_(\{|.)", "", text)
