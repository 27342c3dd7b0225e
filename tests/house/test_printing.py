"""Commands print in one way, which knows what to do where standard output is closed, full or gone."""

import ast

from fixtures.trees import source_texts


def test_only_one_function_prints():
    texts = {file: text for file, text in source_texts().items() if "print(" in text}
    calls = [(file, node.func) for file in texts for node in ast.walk(ast.parse(texts[file])) if hasattr(node, "func")]
    printing = {file for file, function in calls if isinstance(function, ast.Name) and function.id == "print"}
    assert printing == {"documents/console.py"}
