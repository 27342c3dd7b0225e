"""Commands print in one way, which knows what to do where standard output is closed, full or gone."""

import ast

import pytest


@pytest.mark.slow
def test_only_one_function_prints(source):
    printing = {
        file.relative_to(source).as_posix(): node.lineno
        for file in sorted(source.rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    }
    assert list(printing) == ["documents/console.py"]
