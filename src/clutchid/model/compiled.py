"""The compiled kernels of a model variant, from the cache or made from the equations."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, TypeAlias

from clutchid.codegen.cache import generator_files, keep_text, load_module
from clutchid.codegen.kernels import LANES, vector_lanes
from clutchid.codegen.system import System
from clutchid.log.states import STATES, State
from clutchid.model.own.model import OwnModel
from clutchid.model.variants import VARIANTS, check_variant, variant_system
from clutchid.parameters import Parameters

#: A variant by name, or a model of the user's own.
Model: TypeAlias = str | OwnModel

_HERE = Path(__file__).parent


def system(model: Model) -> System:
    """The equations of a model.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    if isinstance(model, OwnModel):
        from clutchid.model.own.system import own_system

        return own_system(model, variant_system(model.base))
    return variant_system(model)


def check_model(model: Model) -> None:
    """Refuse a variant that does not exist; a model of the user's own was checked when it was made.

    Raises
    ------
    ParameterError
        The text has the nearest known one.
    """
    if not isinstance(model, OwnModel):
        check_variant(model)


@cache
def state_rows(model: Model) -> Mapping[str, State]:
    """The states of a model in the order of its kernels, with their rows.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    check_model(model)
    if not isinstance(model, OwnModel):
        return MappingProxyType({name: STATES[name] for name in VARIANTS[model]})
    rows = {name: row for name, row in state_rows(model.base).items() if name not in model.without}
    return MappingProxyType(rows | {name: state.row(name) for name, state in model.states.items()})


@cache
def state_names(model: Model) -> tuple[str, ...]:
    """Names of the states of a model, in the order of its kernels.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    return tuple(state_rows(model))


@cache
def parameter_names(model: Model) -> tuple[str, ...]:
    """Names of the parameters of a model, in the order of its kernels."""
    return (*Parameters.names(), *(model.parameters if isinstance(model, OwnModel) else ()))


@cache
def kernels(model: Model) -> ModuleType:
    """Kernels of `model`: ``run``, ``run_all`` and ``linearise``, and its ``terms`` one after the other.

    The module has ``opening`` and ``passed_pulses`` of `compiled_functions` too. A warm call neither imports SymPy nor
    compiles.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    check_model(model)
    module = load_module(_module_name(model), _sources(), lambda: _kernels_text(model))
    for name in ("opening", "passed_pulses"):
        setattr(module, name, getattr(compiled_functions(), name))
    return module


@cache
def lanes(model: Model) -> ModuleType:
    """The kernel ``run_lanes`` of `model`: as many runs side by side as its ``LANES`` says.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    check_model(model)
    count = vector_lanes()
    return load_module(_lanes_name(model, count), _sources(), lambda: _lanes_text(model, count))


def few_suffice(model: Model, slots: Collection[int]) -> bool:
    """Whether ``step_few`` of `model` computes the derivatives at these places in ``SLOTS``."""
    return bool(kernels(model).FREQUENT) and set(slots).issubset(kernels(model).FREQUENT)


@cache
def step(model: Model, few: bool = False) -> Any:
    """The kernel ``step`` of `model`, to be passed to a kernel that takes one for every model.

    It has one type for all models, so such a kernel is compiled once and its machine code is kept. With `few` it is
    ``step_few``, which computes the derivatives to frequent parameters only.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    from numba import types

    from clutchid.codegen.linked import Callback

    x, S = (types.Array(types.float64, n, "C") for n in (1, 2))
    fixed, load, basis = (types.Array(types.float64, n, "C", readonly=True) for n in (1, 2, 3))
    places = types.Array(types.int64, 1, "C")
    interval, tables = (types.float64, types.int64), (fixed, load, basis)
    kernel = kernels(model).step_few if few else kernels(model).step
    return Callback(kernel, (x, S, fixed, fixed, *interval, *tables, *[places] * 5, x))


@cache
def preparation_kernel(model: Model, few: bool = False) -> Any:
    """The kernel ``preparation_kernel`` of `model`, as `step`: it computes what `step` needs of changed parameters.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    from numba import types

    from clutchid.codegen.linked import Callback

    x, places = types.Array(types.float64, 1, "C"), types.Array(types.int64, 1, "C")
    kernel = kernels(model).prepare_few if few else kernels(model).prepare
    return Callback(kernel, (x, places, x))


@cache
def compiled_functions() -> ModuleType:
    """Compiled functions of the equations of all variants.

    ``paper_table`` is the table of the load's basis, ``opening`` and ``passed_pulses`` those of the valves for arrays.
    """
    return load_module("functions", _sources(), _functions_text)


def compile_ahead(models: Iterable[Model] = tuple(VARIANTS)) -> None:
    """Compile all kernels of some models with the signatures that `simulation` and `filter` call them with.

    What has been compiled before is only loaded. Processes that start afterwards need not compile.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    from numba import types

    x, matrix, cube = (types.Array(types.float64, n, "C") for n in (1, 2, 3))
    fixed, basis = (types.Array(types.float64, n, "C", readonly=True) for n in (1, 3))
    places, counts, flags = (types.Array(kind, 1, "C") for kind in (types.int64, types.int32, types.uint8))
    plan = (matrix, x, x, counts, flags, matrix)
    for model in models:
        module = kernels(model)
        module.run.compile((x, *plan, fixed, matrix, matrix))
        module.run_all.compile((x, matrix, *plan, fixed, matrix, basis, *[places] * 5, places, matrix, cube))
        module.linearise.compile((matrix, matrix, x, fixed, matrix, matrix, cube))
        for few in (False, True)[: 1 + bool(module.FREQUENT)]:
            preparation_kernel(model, few)
            step(model, few)
    compiled_functions().opening.compile((x, types.float64, types.float64))
    compiled_functions().passed_pulses.compile((x, x, x, x, types.float64, types.float64))


def write_texts(folder: Path) -> list[Path]:
    """The texts of `kernels` for all variants and of `compiled_functions`, as files that a wheel brings along."""
    texts = {_module_name(variant): _kernels_text(variant) for variant in VARIANTS} | {"functions": _functions_text()}
    texts |= {_lanes_name(variant, count): _lanes_text(variant, count) for variant in VARIANTS for count in LANES}
    return [keep_text(folder, name, _sources(), text) for name, text in texts.items()]


def _module_name(model: Model) -> str:
    return f"own_{model.sha256[:16]}" if isinstance(model, OwnModel) else model.replace("-", "_")


def _sources() -> list[Path]:
    """The files that the generated text depends on."""
    return [*generator_files(_HERE), _HERE.parent / "parameters.py"]


def _kernels_text(model: Model) -> str:
    from clutchid.codegen.numba_source import numba_source, terms_source

    text = system(model)
    return numba_source(text) + terms_source(text)


def _lanes_name(model: Model, count: int) -> str:
    return f"{_module_name(model)}_{count}_lanes"


def _lanes_text(model: Model, count: int) -> str:
    from clutchid.codegen.numba_source import lanes_source

    return lanes_source(system(model), count)


def _functions_text() -> str:
    import sympy as sp

    from clutchid.codegen.numba_source import elementwise_source, function_source, module_head
    from clutchid.model.load import table_expressions
    from clutchid.model.opening import opening, passed_pulses

    knots = sp.symbols("t_1:5 phi2_slope", real=True)
    u, R_0, R_1, a, b, s, e, c, d = sp.symbols("u R_0 R_1 a b s e c d", real=True)
    return "".join(
        (
            module_head("functions"),
            function_source("paper_table", knots, table_expressions(*knots)),
            elementwise_source("opening", (u,), (R_0, R_1), opening(u, R_0, R_1)),
            elementwise_source("passed_pulses", (a, b, c, d), (s, e), passed_pulses(a, b, s, e, c, d)),
        )
    )
