"""Sizes of files and functions: the trouble is always the one file or function that nobody stopped."""

import ast
from pathlib import Path

MOST_LINES_OF_A_FILE = 300
MOST_LINES_OF_A_FUNCTION = 40

#: Functions that are longer, and how long they may be. This list only shrinks.
LONGER: dict[str, int] = {}


def functions(file: Path) -> list[tuple[str, int]]:
    """Name and number of lines of every function of a file, without its docstring."""
    found = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = node.end_lineno - node.lineno + 1
            if ast.get_docstring(node) is not None:
                lines -= node.body[0].end_lineno - node.body[0].lineno + 1
            found.append((node.name, lines))
    return found


def test_no_source_file_has_more_than_300_lines(source):
    sizes = {str(f.relative_to(source)): len(f.read_text(encoding="utf-8").splitlines()) for f in source.rglob("*.py")}
    assert {name: size for name, size in sizes.items() if size > MOST_LINES_OF_A_FILE} == {}


def test_no_function_has_more_than_40_lines_of_code_but_for_a_list_that_only_shrinks(source):
    sizes: dict[str, int] = {}
    for file in source.rglob("*.py"):
        for name, lines in functions(file):
            key = f"{file.relative_to(source).as_posix()}:{name}"
            sizes[key] = max(lines, sizes.get(key, 0))
    too_long = {key: size for key, size in sizes.items() if size > LONGER.get(key, MOST_LINES_OF_A_FUNCTION)}
    assert too_long == {}
    served = [key for key in LONGER if sizes.get(key, 0) <= MOST_LINES_OF_A_FUNCTION]
    assert served == [], "these are short now: take them from the list"
