"""Words that stop a reader, in the docstrings, comments and messages of the package, and in its documentation."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

#: Rooms and modules whose sentences have not been revised. This list only shrinks.
NOT_REVISED = {"estimation", "inference", "observer"}

#: Pronouns without a noun: say which file, recording, path, ...
EMPTY = re.compile(r"(?<!the )\bone that\b|what is none", re.IGNORECASE)

#: Begins of a docstring that say nothing: a docstring begins with a noun phrase or a verb.
BEGINS = re.compile(r"What |It\.")

#: Names of variables that say nothing of what they hold.
VAGUE = {"found", "one", "known", "done", "kept", "given", "each"}

#: Fields of records whose names are keys of JSON.
FIELDS = {("app/records.py", "found"), ("study/proving/scores.py", "kept")}

DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def revised(source):
    for file in sorted(source.rglob("*.py")):
        name = file.relative_to(source)
        if name.parts[0] not in NOT_REVISED:
            yield name.as_posix(), file.read_text(encoding="utf-8")


def test_sentences_name_their_subject(source):
    lines = ((name, line) for name, text in revised(source) for line in text.splitlines())
    assert [(name, line.strip()) for name, line in lines if EMPTY.search(line)] == []


def test_pages_name_their_subject():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "commands").glob("*.md")]
    lines = ((page.name, line) for page in pages for line in page.read_text(encoding="utf-8").splitlines())
    assert [(name, line) for name, line in lines if EMPTY.search(line)] == []


def test_a_docstring_begins_with_a_noun_phrase_or_a_verb(source):
    docstrings = (
        (name, ast.get_docstring(node) or "")
        for name, text in revised(source)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, DOCUMENTED)
    )
    assert [(name, text.splitlines()[0]) for name, text in docstrings if BEGINS.match(text)] == []


def names_given(tree):
    """Names that are assigned in a module, and those of arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def test_a_variable_is_named_by_what_it_holds(source):
    vague = {
        (name, word) for name, text in revised(source) for word in VAGUE.intersection(names_given(ast.parse(text)))
    }
    assert vague - FIELDS == set()
