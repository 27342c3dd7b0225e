"""Arrays in memory, as SciPy loads them, as the nodes of a MATLAB file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.recordings.formats.mat.tree import (
    COMPLEX,
    FUNCTION,
    NO_NUMBERS,
    SPARSE,
    Items,
    Node,
    Numbers,
    Struct,
    Text,
    class_object,
)


def node(value: Any, decoded: Callable[[Any], Node | None] = lambda _: None) -> Node:
    """What an array is: numbers, a text, a struct, a list of structs or cells, or nothing that is a channel.

    `decoded` gives the node of an object that it knows, None of anything else.
    """
    if known := decoded(value) or _no_array(value):
        return known
    kind = value.dtype.kind
    if kind in "OV":  # column by column, as in MATLAB
        items, fields = list(value.ravel(order="F")), value.dtype.names or ()
        if kind == "O":
            return Items(tuple(node(item, decoded) for item in items), cell=True)
        structs = [Struct({name: node(item[name], decoded) for name in fields}) for item in items]
        return structs[0] if len(structs) == 1 else Items(tuple(structs))
    if kind in "fiub":
        return Numbers(value.shape, value)
    if kind == "U":
        return Text(str(value.item()) if value.size == 1 else "")
    return COMPLEX if kind == "c" else NO_NUMBERS


def _no_array(value: Any) -> Node | None:
    from scipy.io.matlab import MatlabFunction, MatlabOpaque
    from scipy.sparse import issparse

    if value is None:  # a struct without fields
        return Struct({})
    if issparse(value):
        return SPARSE
    if isinstance(value, MatlabFunction):
        return FUNCTION
    if isinstance(value, MatlabOpaque):
        return class_object(_class_name(value))
    return None if isinstance(value, np.ndarray) else NO_NUMBERS


def samples(array: NDArray[Any], numbers: Numbers, channel: int, start: int, stop: int) -> FloatArray:
    """Samples `start` to `stop` of a channel of an array."""
    if numbers.is_vector:
        part = array.ravel()[start:stop]
    else:
        sides = array.squeeze()
        part = sides[channel, start:stop] if numbers.is_wide else sides[start:stop, channel]
    return np.array(part, dtype=np.float64)


def _class_name(value: NDArray[Any]) -> str:
    """Name of the class of an object that SciPy does not decode; the field has this name from SciPy 1.18 on."""
    field = "_Class" if "_Class" in (value.dtype.names or ()) else "s2"
    name = value[field].ravel()[0] if value.size else b""
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)
