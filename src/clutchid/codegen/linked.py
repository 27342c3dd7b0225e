"""Functions in LLVM's text that Numba's kernels call; kernels and records of arrays as arguments of kernels."""

# mypy: disallow-subclassing-any=False, disallow-untyped-calls=False, disallow-untyped-decorators=False

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, Signature
from typing import Any
from weakref import WeakKeyDictionary

from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.core.errors import RequireLiteralValue, TypingError
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.experimental.function_type import FunctionModel
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array

_NUMBERS = {"double": types.float64, "i64": types.int64}

#: Bytes to which rooms on the stack are aligned: those of the widest vectors.
_ALIGNMENT = 64

#: Functions that each library of machine code has been given.
_given: WeakKeyDictionary[Any, set[str]] = WeakKeyDictionary()


def linked(name: str, arguments: Mapping[str, str], text: str) -> Any:
    """The function `name` of the LLVM module `text`, to be called from compiled code.

    Parameters
    ----------
    arguments : Mapping[str, str]
        The LLVM type of each argument: "double", "i64", or "ptr" for an array of float64, contiguous in the order of
        C, of which the address of the first element is passed. Nothing is returned.

    Raises
    ------
    numba.core.errors.TypingError
        When a kernel is compiled that passes an array of another layout or element type.
    """

    def definition(_typing: Any, *passed: Any) -> Any:
        pairs = zip(arguments.items(), passed, strict=True)
        taken = tuple(_array(name, of, argument) if kind == "ptr" else _NUMBERS[kind] for (of, kind), argument in pairs)
        return types.void(*taken), _call(name, text)

    # Numba matches arguments by the names of a signature; it cannot count a tuple of them
    definition.__signature__ = Signature(  # type: ignore[attr-defined]
        [Parameter(argument, Parameter.POSITIONAL_OR_KEYWORD) for argument in ("typing", *arguments)]
    )
    return intrinsic(definition)


def _array(name: str, argument: str, kind: Any) -> Any:
    if not isinstance(kind, types.Array) or kind.layout != "C" or kind.dtype != types.float64:
        raise TypingError(f"{name}: {argument} is {kind}; wanted is an array of float64 in the order of C.")
    return kind


def _call(name: str, text: str) -> Callable[..., Any]:
    def call(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
        # a name for each kernel: of two definitions of one name the first that is loaded would serve both kernels, and
        # they round differently
        library, own = context.active_code_library, f"{name}.{builder.function.name}"
        if own not in _given.setdefault(library, set()):
            _given[library].add(own)
            library.add_llvm_module(binding.parse_assembly(text.replace(f"@{name}(", f'@"{own}"(')))
        passed = [
            context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
            for kind, value in zip(signature.args, values, strict=True)
        ]
        kind = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
        builder.call(cgutils.get_or_insert_function(builder.module, kind, own), passed)
        return context.get_dummy_value()

    return call


@intrinsic
def room(_typing: Any, size: Any) -> Any:
    """An array of `size` numbers, a literal, on the stack of the kernel; it may become registers."""
    if not isinstance(size, types.IntegerLiteral):
        raise RequireLiteralValue("the size of a room on the stack")
    kind, count = types.Array(types.float64, 1, "C"), size.literal_value

    def place(context: Any, builder: Any, _signature: Any, _values: Sequence[Any]) -> Any:
        numbers = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), count))
        numbers.align = _ALIGNMENT
        array = context.make_array(kind)(context, builder)
        extent, step = context.get_constant(types.intp, count), context.get_constant(types.intp, 8)
        first = builder.bitcast(numbers, ir.DoubleType().as_pointer())
        populate_array(array, first, [extent], [step], step, None)
        return array._getvalue()

    return kind(size), place


class CallbackType(types.FunctionType):
    """Type of a `Callback`."""


register_model(CallbackType)(FunctionModel)


@unbox(CallbackType)
def _function(kind: Any, callback: Any, c: Any) -> NativeValue:
    """A callback for compiled code, by its address, for which Numba would call Python twice: 4 µs at each call."""
    function = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    address = c.pyapi.object_getattr_string(callback, "address")
    function.c_addr = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    function.py_addr = c.builder.ptrtoint(callback, c.context.get_value_type(types.voidptr))
    function.jit_addr = c.context.get_constant_null(types.voidptr)
    return NativeValue(function._getvalue())


class Callback:
    """A kernel for arguments of fixed types, to be passed to a kernel that calls it by its address.

    All callbacks with the same argument and result types are of one type, so a kernel that takes one is compiled once,
    and its machine code is kept on disk. Never pass a kernel without this: Numba would compile a copy in every process,
    and keep it under a type that other processes may be unable to read.
    """

    def __init__(self, function: Any, arguments: tuple[Any, ...]) -> None:
        function.compile(arguments)
        compiled = function.overloads[arguments]
        name = compiled.fndesc.llvm_cfunc_wrapper_name
        self.address: int = compiled.library.get_pointer_to_function(name)
        self.type = CallbackType(compiled.signature)


@typeof_impl.register(Callback)
def _type(callback: Callback, _context: Any) -> Any:
    """The type that Numba would make of the signature at every call, which takes as long as some samples."""
    return callback.type


class RecordType(types.Type):
    """Type of the address of a named tuple's values."""

    def __init__(self, values: Any) -> None:
        self.values = values
        super().__init__(f"Record({values})")

    @property
    def key(self) -> Any:
        """The class and its fields, by which two types are the same, and not by their words alone."""
        return self.values


register_model(RecordType)(models.OpaqueModel)


def by_address(*kinds: type[tuple[Any, ...]]) -> None:
    """Let kernels take named tuples of these classes by address; they read fields by name, and do not change them.

    Else Numba copies all fields wherever one is read, and counts references to each array: with the 79 arrays of the
    filter that was a quarter of its compilation. The caller of a kernel holds the arrays meanwhile.
    """
    for kind in kinds:
        typeof_impl.register(kind)(_record_type)


def _record_type(record: Any, context: Any) -> RecordType:
    return RecordType(types.BaseTuple.from_types([typeof_impl(value, context) for value in record], type(record)))


@unbox(RecordType)
def _address(kind: Any, record: Any, c: Any) -> NativeValue:
    values = c.unbox(kind.values, record)
    place = c.builder.bitcast(cgutils.alloca_once_value(c.builder, values.value), cgutils.voidptr_t)

    def free() -> None:
        if values.cleanup is not None:
            values.cleanup()
        c.context.nrt.decref(c.builder, kind.values, values.value)

    return NativeValue(place, is_error=values.is_error, cleanup=free)


@infer_getattr
class _Fields(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, record: Any, name: str) -> Any:  # type: ignore[override]
        """Type of a field: of a named tuple inside, its address."""
        if name not in record.values.fields:
            return None
        kind = record.values[record.values.fields.index(name)]
        return RecordType(kind) if isinstance(kind, types.BaseNamedTuple) else kind


@lower_getattr_generic(RecordType)
def _field(context: Any, builder: Any, kind: Any, record: Any, name: str) -> Any:
    values = builder.bitcast(record, context.get_value_type(kind.values).as_pointer())
    number = kind.values.fields.index(name)
    place, of = cgutils.gep_inbounds(builder, values, 0, number), kind.values[number]
    if isinstance(of, types.BaseNamedTuple):
        return builder.bitcast(place, cgutils.voidptr_t)
    value = builder.load(place)
    if isinstance(of, types.Array):  # without a count of references
        array = context.make_array(of)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    return impl_ret_borrowed(context, builder, of, value)
