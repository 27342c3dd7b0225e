"""JSON as commands and the page write it."""

from __future__ import annotations

import json
from math import isfinite
from numbers import Integral, Real
from typing import Any


def json_text(content: Any) -> str:
    """JSON in ASCII, for any encoding of the output; numbers that are not finite become null.

    Examples
    --------
    >>> json_text({"width_m": float("inf"), "unit": "µm"})
    '{"width_m": null, "unit": "\\\\u00b5m"}'
    """
    return json.dumps(_finite(content), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    if not isinstance(value, Real) or isinstance(value, Integral):
        return value
    return float(value) if isfinite(value) else None
