"""How large the house is, and whether its rooms keep their order: ``python benchmarks/house.py [--ref COMMIT]``.

Code lines are those of ``src`` without docstrings, comments and blank lines, without imports but with ``--imports``;
templates stand beside them, vendored ones left out. Foreign modules of a room are those of other rooms that its files
import. A circle is a group of files that import each other in a loop, imports within functions included, those for type
checkers only left out. ``--rooms`` prints the size of each room, with imports, and its limit in pyproject.toml.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

TEMPLATES = (".j2", ".toml", ".js", ".css", ".html")


def modules(source: Path) -> dict[str, Path]:
    """Every module by its name, that of a package being its `__init__`."""
    files = {}
    for path in sorted((source / "clutchid").rglob("*.py")):
        parts = path.relative_to(source).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return files


def imported(tree: ast.AST, files: Mapping[str, Path]) -> Iterator[str]:
    """Names of the modules that a file imports when it runs."""
    if isinstance(tree, ast.If) and isinstance(tree.test, ast.Name) and tree.test.id == "TYPE_CHECKING":
        return
    if isinstance(tree, ast.ImportFrom) and tree.module:
        for alias in tree.names:
            inner = f"{tree.module}.{alias.name}"
            yield inner if inner in files else tree.module
    elif isinstance(tree, ast.Import):
        yield from (alias.name for alias in tree.names)
    for child in ast.iter_child_nodes(tree):
        yield from imported(child, files)


def circles(source: Path) -> list[list[str]]:
    """Groups of modules that import each other in a loop, the largest first (Tarjan 1972)."""
    files = modules(source)
    graph = {
        name: {
            target
            for target in imported(ast.parse(path.read_text("utf-8")), files)
            if target in files and target != name
        }
        for name, path in files.items()
    }
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    loops: list[list[str]] = []

    def visit(name: str) -> None:
        number[name] = low[name] = len(number)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in number:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], number[other])
        if low[name] == number[name]:
            at = stack.index(name)
            group = stack[at:]
            del stack[at:]
            if len(group) > 1:
                loops.append(group)

    for name in graph:
        if name not in number:
            visit(name)
    return sorted(loops, key=len, reverse=True)


#: Rooms whose foreign modules are counted: the doors, and what renders results.
DOORS = ("cli", "app", "fleets", "study", "documents", "verbs")


def foreign(source: Path, rooms: tuple[str, ...]) -> int:
    """Number of modules of other rooms that the files of some rooms import when they run."""
    files = modules(source)
    imports = {
        target.removeprefix("clutchid.")
        for name, path in files.items()
        if name.split(".")[1:2] and name.split(".")[1] in rooms
        for target in imported(ast.parse(path.read_text("utf-8")), files)
        if target in files
    }
    return sum(1 for target in imports if target.partition(".")[0] not in rooms)


def code_lines(path: Path, *, imports: bool = False) -> int:
    """Lines of code of a file without docstrings, comments and blank lines, and without imports unless asked for."""
    text = path.read_text("utf-8")
    tree, taken = ast.parse(text), set()
    for node in ast.walk(tree):
        is_text = (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        if is_text or (not imports and isinstance(node, (ast.Import, ast.ImportFrom))):
            taken |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = enumerate(text.splitlines(), 1)
    return sum(1 for n, line in lines if n not in taken and line.strip() and not line.strip().startswith("#"))


#: Room of the files that lie beside the packages.
FILES = "files beside the packages"


def sizes(root: Path) -> dict[str, int]:
    """Sizes that have a limit: code lines of each room with imports, of src and tests; lines of templates; words."""
    package, rooms = root / "src" / "clutchid", {FILES: 0}
    for path in package.rglob("*.py"):
        place = path.relative_to(package).parts
        room = place[0] if len(place) > 1 else FILES
        rooms[room] = rooms.get(room, 0) + code_lines(path, imports=True)
    return {
        **dict(sorted(rooms.items())),
        "src": sum(rooms.values()),
        "templates": template_lines(package),
        "tests": sum(code_lines(path, imports=True) for path in (root / "tests").rglob("*.py")),
        "docs": words(root),
    }


def over(measures: Mapping[str, int], limits: Mapping[str, int]) -> list[str]:
    """Sentences on the sizes that exceed their limit, or have none."""
    return [
        f"{name}: {size:,} is {size - limits[name]:,} over its limit of {limits[name]:,}"
        if name in limits
        else f"{name}: {size:,} has no limit in [tool.house]"
        for name, size in measures.items()
        if size > limits.get(name, -1)
    ]


def limits_of(root: Path) -> dict[str, int]:
    """The limits of sizes, from pyproject.toml."""
    limits: dict[str, int] = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["tool"]["house"]
    return limits


def template_lines(package: Path) -> int:
    """Lines of templates, vendored files left out."""
    templates = [path for path in package.rglob("*") if path.suffix in TEMPLATES and "vendor" not in path.parts]
    return sum(len(path.read_text("utf-8").splitlines()) for path in templates)


def words(root: Path) -> int:
    """Words of the documentation."""
    return sum(len(path.read_text("utf-8").split()) for path in (root / "docs").rglob("*.md"))


def measured(root: Path, *, imports: bool = False) -> dict[str, str]:
    """The measures of a work tree."""
    source = root / "src"
    package = source / "clutchid"
    files = [*modules(source).values()]
    contracts = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    loops, tests = circles(source), [*(root / "tests").rglob("*.py")]
    entries = [path for path in package.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()]
    return {
        "code lines": f"{sum(code_lines(path, imports=imports) for path in files):,}",
        "lines of templates": f"{template_lines(package):,}",
        "files": str(len(files)),
        "entries in src/clutchid": str(len(entries)),
        "exceptions of the import contract": str(len(contracts[0].get("ignore_imports", []))),
        "circles, files in the largest": f"{len(loops)}, {len(loops[0]) if loops else 0}",
        "code lines of tests": f"{sum(code_lines(path, imports=imports) for path in tests):,}",
        **{
            f"foreign modules of {room}": str(foreign(source, (room, "reports") if room == "documents" else (room,)))
            for room in DOORS
        },
        "words of docs": f"{words(root):,}",
    }


def main() -> None:
    """Print the measures of the work tree, and beside them those of another commit."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--ref", default="", help="a commit to compare with")
    parser.add_argument("--imports", action="store_true", help="count the lines of imports too")
    parser.add_argument("--rooms", action="store_true", help="print the size and the limit of each room")
    options = parser.parse_args()
    if options.rooms:
        limits = limits_of(ROOT)
        for name, size in sizes(ROOT).items():
            print(f"{name:28s} {size:>8,} {limits.get(name, 0):>8,}")
        return
    now, before = measured(ROOT, imports=options.imports), {}
    if options.ref:
        with tempfile.TemporaryDirectory() as folder:
            archive = subprocess.run(["git", "archive", options.ref], cwd=ROOT, check=True, capture_output=True).stdout
            subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
            before = measured(Path(folder), imports=options.imports)
    for name, value in now.items():
        print(f"{name:36s} {before.get(name, ''):>10s} {value:>10s}")


if __name__ == "__main__":
    main()
