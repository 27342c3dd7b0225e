"""Words that stop a reader, in the docstrings, comments and messages of the package, and in its documentation."""

import ast
import itertools
import re
from pathlib import Path

from fixtures.trees import source_nodes, source_texts

ROOT = Path(__file__).resolve().parents[2]

#: Pronouns without a noun: say which file, recording, path, ...
EMPTY = re.compile(r"(?<!the )\bone that\b|what is none", re.IGNORECASE)

#: Begins of a docstring that say nothing: a docstring begins with a noun phrase or a verb.
BEGINS = re.compile(r"What |It\.")

#: Names of variables that say nothing of what they hold.
VAGUE = {"found", "one", "known", "done", "kept", "given", "each"}

#: Fields of records whose names are keys of JSON or of a state, or public; of a program, the constants it knows.
FIELDS = {
    ("app/records.py", "found"), ("observer/by_stroke.py", "known"), ("inference/filter/references.py", "known"),
    ("benchmarks/instructions.py", "known"), ("benchmarks/wear_drawn.py", "known"),
    ("benchmarks/peers/ekf_in_c.py", "given"),
}  # fmt: skip

DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def test_sentences_name_their_subject():
    lines = ((file, line) for file, text in source_texts().items() for line in text.splitlines())
    assert [(file, line.strip()) for file, line in lines if EMPTY.search(line)] == []


def test_pages_name_their_subject():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "commands").glob("*.md")]
    lines = ((page.name, line) for page in pages for line in page.read_text(encoding="utf-8").splitlines())
    assert [(name, line) for name, line in lines if EMPTY.search(line)] == []


def test_a_docstring_begins_with_a_noun_phrase_or_a_verb():
    documented = ((file, node) for file, node in source_nodes() if isinstance(node, DOCUMENTED))
    docstrings = ((file, ast.get_docstring(node) or "") for file, node in documented)
    assert [(file, text.splitlines()[0]) for file, text in docstrings if BEGINS.match(text)] == []


def name_given(node):
    """Name that a node assigns, or that of an argument."""
    if isinstance(node, ast.arg):
        return node.arg
    return node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else None


def scripts():
    """Every node of benchmarks, scripts of the documentation and tests, with the path of its file."""
    for folder in ("benchmarks", "docs", "tests"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            file = path.relative_to(ROOT).as_posix()
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                yield file, node


def test_a_variable_is_named_by_what_it_holds():
    nodes = itertools.chain(source_nodes(), scripts())
    vague = {(file, name_given(node)) for file, node in nodes if name_given(node) in VAGUE}
    assert vague - FIELDS == set()
