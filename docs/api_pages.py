"""Pages of the API reference for the site: one for each public name, and one for each record that a result holds."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
import typing
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module

import clutchid

#: What the page of Python uses beside the names of `clutchid`.
FURTHER = {
    "clutchid.observer": (
        "observer", "start", "observe", "observe_recording", "curve", "estimates_of", "read_state", "write_state",
    ),
    "clutchid.fleets.cluster": ("Workers",),
    "clutchid.verbs.tracking": ("write_tracked",),
}  # fmt: skip

#: Modules with the equations, in the order of the paper.
EQUATIONS = ("motion", "friction", "chambers", "valves", "opening", "supply", "load", "isothermal", "static")

#: Records that results hold for the machine: states, arrays and kernels of filters. They have no page.
INTERNAL = {
    "ActiveColumns", "Columns", "Coordinate", "FreeArrays", "GroupChange", "JointFilter",
    "JointSettings", "JointState", "KernelArrays", "LoadPieces", "MovingColumns", "Noise", "ObserverState",
    "OnlinePrior", "ParameterMap", "PositionOnlyErrors", "RestWatch", "RecordedSupply", "Strokes", "Tail", "Vehicle",
    "_Run",
}  # fmt: skip


def is_record(value: object) -> typing.TypeGuard[type]:
    """Whether `found` is a dataclass or a named tuple of clutchid."""
    if not inspect.isclass(value) or not value.__module__.startswith("clutchid."):
        return False
    return dataclasses.is_dataclass(value) or hasattr(value, "_fields")


def fields_of(record: type) -> tuple[str, ...]:
    """Names of the public fields of a record."""
    if dataclasses.is_dataclass(record):
        names = tuple(field.name for field in dataclasses.fields(record))
    else:
        names = tuple(getattr(record, "_fields", ()))
    return tuple(name for name in names if not name.startswith("_"))


@cache
def records() -> tuple[type, ...]:
    """Every record that people get from a public name: its own, its result, and what those hold; in that order."""
    public = [getattr(clutchid, name) for name in clutchid.__all__]
    todo = [value for value in public if is_record(value)]
    for function in filter(inspect.isfunction, public):
        todo += _records_in(_hints(function).get("return"))
    record_types: dict[type, None] = {}
    while todo:
        record = todo.pop(0)
        if record in record_types or record.__name__ in INTERNAL:
            continue
        record_types[record] = None
        for hint in _hints(record).values():
            todo += _records_in(hint)
    return tuple(record_types)


def _records_in(hint: object) -> Iterator[type]:
    if is_record(hint):
        yield hint
    for argument in typing.get_args(hint):
        yield from _records_in(argument)


def _hints(item: typing.Any) -> dict[str, typing.Any]:
    """Annotations of a function or a class, also those whose names its module imports for type checkers only."""
    module = sys.modules[item.__module__]
    names: dict[str, typing.Any] = {}
    for block in re.findall(r"^if TYPE_CHECKING:\n((?:    .*\n|\n)+)", inspect.getsource(module), re.MULTILINE):
        exec(inspect.cleandoc(block), names)
    return typing.get_type_hints(item, localns=names)


def places_of_records() -> dict[str, str]:
    """Full names of the records by name, as their pages have them."""
    public = set(clutchid.__all__)
    return {
        record.__name__: f"{'clutchid' if record.__name__ in public else record.__module__}.{record.__name__}"
        for record in records()
    }


def described(item: type) -> set[str]:
    """Fields that the sections Parameters and Attributes of a docstring describe."""
    sections = re.findall(r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=\n\n\S+[^\n]*\n---|\Z)", _doc(item), re.M | re.S)
    entries = [entry for section in sections for entry in re.findall(r"^(\S[^\n]*)\n(?=    \S)", section, re.M)]
    return {name.strip() for entry in entries for name in entry.partition(" : ")[0].split(",")}


def _doc(item: object) -> str:
    return inspect.getdoc(item) or ""


def page_name(name: str) -> str:
    """Name of the page of a public name: `Fit` and `fit` are one file on some systems."""
    return f"class_{name}" if inspect.isclass(getattr(clutchid, name, None)) else name


def api_pages(parameter_table: str) -> dict[str, str]:
    """The pages by file name; `parameter_table`, Markdown, goes on the page of `Parameters`."""
    public = {page_name(name): _page(name, "clutchid", getattr(clutchid, name)) for name in clutchid.__all__}
    offered = {getattr(clutchid, name) for name in clutchid.__all__}
    held = [record for record in records() if record not in offered]
    pages = public | {f"record_{kind.__name__}": _page(kind.__name__, kind.__module__, kind) for kind in held}
    further = {
        f"further_{name}": _page(name, module, getattr(import_module(module), name))
        for module, names in FURTHER.items()
        for name in names
        if f"record_{name}" not in pages
    }
    equations = {f"equations_{name}": _module(f"clutchid.model.{name}") for name in EQUATIONS}
    pages |= further | equations | {"index": _index(held, [*further], [*equations])}
    # the others are found by links and by search: in the navigation of each page they would double the time of a build
    pages = {name: text if name in {*public, "index"} else f":orphan:\n\n{text}" for name, text in pages.items()}
    files = {f"{name}.rst": text for name, text in pages.items() if name != "class_Parameters"}
    return files | {"class_Parameters.md": _parameters(parameter_table)}


def _heading(text: str, under: str = "=") -> str:
    return f"{text}\n{under * len(text)}\n"


def _page(name: str, module: str, item: object) -> str:
    heading = f"{name}\n{'=' * len(name)}\n\n.. currentmodule:: {module}\n\n"
    if not inspect.isclass(item):
        return f"{heading}.. autofunction:: {module}.{name}\n"
    if issubclass(item, BaseException):
        return f"{heading}.. autoexception:: {module}.{name}\n   :show-inheritance:\n"
    hidden = ", ".join(fields_of(item)) if is_record(item) else ""
    options = "   :members:\n" + (f"   :exclude-members: {hidden}\n" if hidden else "")
    made_by_clutchid = "\nAttributes\n---" in _doc(item)  # its fields are described, and nobody calls it
    return f"{heading}.. autoclass:: {module}.{name}{'()' * made_by_clutchid}\n{options}"


def _parameters(rows: str) -> str:
    """The page of `Parameters` as Markdown: without its signature of 62 numbers, but with its rows."""
    hidden = ", ".join(fields_of(clutchid.Parameters))
    text = f".. autoclass:: clutchid.Parameters()\n   :members:\n   :exclude-members: {hidden}\n"
    return f"# Parameters\n\n```{{eval-rst}}\n.. currentmodule:: clutchid\n\n{text}```\n\n## The rows\n\n{rows}\n"


def _module(name: str) -> str:
    return f"{_heading(name)}\n.. automodule:: {name}\n   :members:\n   :exclude-members: Load\n"


def _summary(names: Sequence[tuple[str, str, object]]) -> str:
    """A list of names with the first lines of their docstrings, as far as the first full stop."""
    return "".join(f":doc:`{shown} <{page}>`\n   {_first(item)}\n\n" for shown, page, item in names)


def _first(item: object) -> str:
    return " ".join(_doc(item).partition("\n\n")[0].split())


def _index(held: Sequence[type], further: Sequence[str], equations: Sequence[str]) -> str:
    offered = [(name, page_name(name), getattr(clutchid, name)) for name in sorted(clutchid.__all__)]
    functions = [row for row in offered if inspect.isfunction(row[2])]
    classes = [row for row in offered if inspect.isclass(row[2]) and not issubclass(row[2], BaseException)]
    errors = [row for row in offered if row not in functions and row not in classes]
    beside = [(f"{module}.{name}", f"further_{name}", getattr(import_module(module), name))
              for module, names in FURTHER.items() for name in names if f"further_{name}" in further]  # fmt: skip
    inside = sorted((record.__name__, f"record_{record.__name__}", record) for record in held)
    texts = [(page.removeprefix("equations_"), page, import_module(f"clutchid.model.{page.removeprefix('equations_')}"))
             for page in equations]  # fmt: skip
    parts = [_heading("API reference"), "All values are in SI. Names are taken from ``clutchid``.\n"]
    for title, rows in (
        ("Functions", functions), ("Classes", classes), ("Errors", errors), ("More functions", beside),
        ("What results hold", inside), ("Equations", texts),
    ):  # fmt: skip
        parts += [_heading(title, "-"), _summary(rows)]
    entries = "".join(f"   {name} <{page}>\n" for name, page, _ in (*functions, *classes, *errors))
    return "\n".join([*parts, f".. toctree::\n   :hidden:\n\n{entries}"])
