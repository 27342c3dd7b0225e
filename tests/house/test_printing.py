"""Commands print in one way, which knows what to do where standard output is closed, full or gone."""

import ast

from fixtures.trees import source_nodes


def test_only_one_function_prints():
    calls = [(file, node.func) for file, node in source_nodes() if isinstance(node, ast.Call)]
    printing = {file for file, function in calls if isinstance(function, ast.Name) and function.id == "print"}
    assert printing == {"documents/console.py"}
