"""The pages explain what the program says: reasons of the verdict, checks, messages; and in its words."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import clutchid
from clutchid.preparation.inspection import inspect
from clutchid.preparation.inspection.columns import VENTED_REST
from fixtures.trees import constant_texts, source_texts, source_tree

ROOT = Path(__file__).resolve().parents[2]
PAGES = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}


def texts(node: ast.AST) -> list[str]:
    """Constant texts in the source below a node; a place of an f-string ends one."""
    return [n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def section(page: str, heading: str) -> str:
    return re.search(rf"^#+ {heading}\n(.*?)(?=^#|\Z)", page, re.MULTILINE | re.DOTALL)[1]


def messages(text: str) -> list[str]:
    """What the first column of a table quotes."""
    cells = re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)
    return [quoted for cell in cells for quoted in re.findall(r"`([^`]+)`", cell)]


def first_arguments(file: str, function: str) -> list[str]:
    """Constant texts that are the first argument of calls of a function."""
    tree = source_tree(file)
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == function]
    return [call.args[0].value for call in calls if isinstance(call.args[0], ast.Constant)]


def pieces(message: str) -> list[str]:
    """Parts of a message between the places of names and figures."""
    return [piece.strip() for piece in message.split("…") if len(piece.strip()) > 3]


def made_by(function: ast.FunctionDef) -> list[str]:
    """The texts of the reasons that a function makes, also of those that it makes of a variable."""
    nodes = list(ast.walk(function))
    assigned = {
        n.targets[0].id: texts(n) for n in nodes if isinstance(n, ast.Assign) and isinstance(n.targets[0], ast.Name)
    }
    calls = [n for n in nodes if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "Reason"]
    names = [[n.id for n in ast.walk(call) if isinstance(n, ast.Name) and n.id in assigned] for call in calls]
    return [
        "\n".join([*texts(call), *(text for name in used for text in assigned[name])])
        for call, used in zip(calls, names, strict=True)
    ]


@pytest.mark.slow
def test_every_message_that_the_pages_quote_is_one_of_the_program():
    codes = (compile(text, file, "exec") for file, text in source_texts().items())
    printed = "\n".join(text for code in codes for text in constant_texts(code))
    tables = PAGES["trouble"].partition("## Files that are not read")[2] + section(PAGES["result"], "Reasons")
    quoted = messages(tables)
    assert len(quoted) > 30
    assert [message for message in quoted for piece in pieces(message) if piece not in printed] == []


def test_every_reason_that_a_verdict_can_give_is_explained():
    tree = source_tree("estimation/assess/reasons.py")
    explained = {piece for message in messages(section(PAGES["result"], "Reasons")) for piece in pieces(message)}
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    reasons = [reason for function in functions for reason in made_by(function)]
    assert len(reasons) >= 13
    assert [reason for reason in reasons if not any(piece in reason for piece in explained)] == []


def test_every_check_of_a_recording_is_explained():
    log = clutchid.bundled_recording()
    whole = log.with_columns(temperature_ambient=np.full(len(log), 293.15), pressure_supply=np.full(len(log), 9e5))
    names = {check.name for check in inspect(whole, clutchid.Actuator()).checks} | {VENTED_REST}
    assert names == set(messages(section(PAGES["trouble"], "What look checks")))


def test_every_section_of_the_page_of_a_fit_is_explained():
    files = ("documents/fit_sections.py", "documents/comparison.py")
    headings = [heading for file in files for heading in first_arguments(file, "Chapter")]
    explained = section(PAGES["result"], "The page")
    assert len(headings) >= 5
    assert [heading for heading in headings if f"| {heading} |" not in explained] == []


def test_every_line_that_a_fit_prints_is_explained():
    labels = {label for file in ("documents/fit_rows.py", "cli/fit.py") for label in first_arguments(file, "LabelRow")}
    assert labels >= {"trust", "load", "errors", "next"}
    assert labels - {"", None} - set(messages(section(PAGES["result"], "The lines"))) == set()


def test_the_terms_of_the_glossary_are_in_order_and_explained_briefly():
    entries = re.findall(r"^### ([^\n]+)\n\n(.*?)(?=^###|\Z)", PAGES["glossary"], re.MULTILINE | re.DOTALL)
    terms = [term.lower() for term, _ in entries]
    assert terms == sorted(set(terms))
    assert [term for term, text in entries if not 1 <= len(text.strip().splitlines()) <= 3] == []


def test_the_glossary_has_the_words_of_the_first_hour():
    terms = re.findall(r"^### (.+)$", PAGES["glossary"], re.MULTILINE)
    words = {word for term in terms for word in term.split(", ")}
    needed = {"ballistic", "partitioned", "theta", "half-load position", "touch point", "calibration", "reading"}
    assert needed | {"baseline", "trust", "carrier", "duty cycle", "innovation", "prior", "vented rest"} <= words
