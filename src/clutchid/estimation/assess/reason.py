"""A reason that lowers the trust in a fit."""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """A sentence for the user; a grave one takes the trust. One that is `banded` only says how wide the interval is."""

    text: str
    grave: bool = False
    banded: bool = False
