"""The gate of a `Log`: numbers from whatever holds them, as arrays that nobody can change afterwards."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: What arrays hold that are no numbers, by the kind of their type in NumPy.
_HELD = {"c": "complex numbers", "b": "truth values", "M": "dates", "m": "durations", "O": "objects"}


def as_numbers(
    values: Any, place: str, si: str, problems: list[str], start: np.datetime64 | None = None, *, truth: bool = False
) -> tuple[NDArray[np.float64], np.datetime64 | None]:
    """Contiguous read-only numbers, and the date that times count from, None where they are not dates.

    Read-only arrays of numbers are taken as they are, others are copied; what a mask hides is NaN. A quantity with a
    unit, and objects that hold no real numbers, is refused: then there are none.

    Parameters
    ----------
    values
        Numbers, or dates and durations where `si` is "s": those are converted, dates from `start`, by default the
        first of them.
    place, si
        What messages call them, and the unit that they are in.
    problems
        Where the reason for a refusal is added.
    start
        See `values`.
    truth
        Whether truth values are numbers, as those of a valve that is open or shut.

    Examples
    --------
    >>> as_numbers(np.ma.masked_greater([0.01, 99.0], 1.0), "column 'position'", "m", [])[0].tolist()
    [0.01, nan]
    >>> dates = np.array(["2026-05-01T12:00:00.000", "2026-05-01T12:00:00.001"], dtype="datetime64")
    >>> as_numbers(dates, "time", "s", [])[0].tolist()
    [0.0, 0.001]
    """
    if type(values) is np.ndarray and values.dtype == np.float64 and _sealed(values):
        return values, None
    try:
        plain, begin = _plain(values, si, start)
    except TypeError as error:
        problems.append(f"{place} {str(error).rstrip('.')}.")
        return np.zeros(0), start
    kind = plain.dtype.kind
    if kind not in ("fiub" if truth else "fiu"):
        way = "dates as datetime64" if si == "s" else "NaN where a sample is missing"
        problems.append(f"{place} holds {_HELD.get(kind, 'text')}: real numbers in {si} are needed, {way}.")
        return np.zeros(0), start
    array = np.array(plain, dtype=np.float64, order="C")
    if isinstance(values, np.ma.MaskedArray):
        array[np.ma.getmaskarray(values)] = np.nan
    array.flags.writeable = False
    return array, begin


def _plain(values: Any, si: str, start: np.datetime64 | None) -> tuple[NDArray[Any], np.datetime64 | None]:
    """Values as an array, of dates and durations in seconds, and the date that these count from.

    Raises
    ------
    TypeError
        If they are a quantity, or no array.
    """
    first = values[0] if isinstance(values, list | tuple) and len(values) else values
    unit = getattr(first, "units", getattr(first, "unit", None))
    if unit is not None and hasattr(first, "to"):
        raise TypeError(f"is a quantity in {unit}: take q.m_as('{si}') of pint, or q.to_value('{si}') of astropy")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise TypeError(f"is not an array ({error})") from None
    if array.dtype.kind not in "mM" or si != "s":
        return array, None
    dates = array.dtype.kind == "M" and array.size > 0
    begin = (array.flat[0] if start is None else start) if dates else None
    return (array - begin if dates else array) / np.timedelta64(1, "s"), begin


def _sealed(array: Any) -> bool:
    """Whether an array is contiguous and cannot be written to, nor what it is a view of."""
    sealed = isinstance(array, np.ndarray) and array.flags.c_contiguous and not array.flags.writeable
    return sealed and (array.base is None or _sealed(array.base))
