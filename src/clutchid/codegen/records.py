"""Records that kernels take and C has as structures: classes whose annotations name their fields.

A record is an element of a structured array, which kernels change in place.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, TypeVar, cast, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

#: A number that is never negative, as of microseconds: 32 bits in C.
Count: TypeAlias = Annotated[int, "count"]

#: An array of records.
Records: TypeAlias = NDArray[np.void]

_Record = TypeVar("_Record")


class Field(NamedTuple):
    """Field of a record: its kind, and the size of an array; 0 for a number."""

    name: str
    kind: Literal["real", "int", "count"]
    size: int


def fields_of(record: type) -> Iterator[Field]:
    """The fields of a record in their order; an array is ``Annotated[FloatArray, size]``."""
    for name, hint in get_type_hints(record, include_extras=True).items():
        size = next((part for part in get_args(hint)[1:] if isinstance(part, int)), 0)
        yield Field(name, "count" if hint == Count else "int" if hint is int else "real", size)


@cache
def layout(record: type) -> np.dtype[np.void]:
    """Layout of a record in memory, for arrays of it."""
    places = [
        (field.name, "f8" if field.kind == "real" else "i8", (field.size,) if field.size else ())
        for field in fields_of(record)
    ]
    return np.dtype(places, align=True)


def new_record(record: type[_Record], **values: Any) -> _Record:
    """A record with some values, and 0 in the others."""
    made = np.zeros(1, layout(cast(Any, record))).view(np.recarray)[0]
    for name, value in values.items():
        made[name] = value
    return cast(_Record, made)


def record_copy(record: _Record, **values: Any) -> _Record:
    """A copy of a record, with other values."""
    made = cast(Any, record).copy()
    for name, value in values.items():
        made[name] = value
    return cast(_Record, made)


def values_in(record: object) -> dict[str, Any]:
    """The values of a record by name; those of an array as a list."""
    of = cast(Any, record)
    return {name: of[name].tolist() for name in of.dtype.names}
