"""Every name that a benchmark imports is there, so that a name that moves breaks none of them."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


def imported(path):
    """Modules of the package and of the benchmarks, with the names that a file imports from them."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)


def is_there(module, name):
    """Whether a module has a name, or a module of it has that name; a benchmark is read, not run."""
    if (BENCHMARKS / f"{module}.py").exists():
        tree = ast.parse((BENCHMARKS / f"{module}.py").read_text(encoding="utf-8"))
        return name in {n for node in tree.body for n in bound(node)}
    parent = import_module(module)
    return hasattr(parent, name) or (hasattr(parent, "__path__") and find_spec(f"{module}.{name}") is not None)


def bound(node):
    """Names that a statement at the top of a file binds."""
    if isinstance(node, ast.ImportFrom | ast.Import):
        return [alias.asname or alias.name for alias in node.names]
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    return [n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*.py")), ids=lambda path: path.stem)
def test_a_benchmark_imports_names_that_are_there(path):
    own = [
        (module, name)
        for module, name in imported(path)
        if module.startswith("clutchid") or (BENCHMARKS / f"{module}.py").exists()
    ]
    assert [pair for pair in own if not is_there(*pair)] == []
