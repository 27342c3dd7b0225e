"""Outputs of an exported observer by sample."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Output(NamedTuple):
    """A field of NAME_output_t: meaning, and its unit in SI; an empty one is a count."""

    meaning: str
    unit: str


#: Fields of NAME_output_t, in their order.
OUTPUTS: Mapping[str, Output] = MappingProxyType({
    "pressure_a": Output("absolute pressure in chamber A; NaN where unknown", "Pa"),
    "pressure_a_std": Output("standard deviation of the pressure in chamber A at the last correction", "Pa"),
    "position": Output("position of the piston, from the vented rest of the calibration", "m"),
    "velocity": Output("velocity of the piston", "m/s"),
    "innovation": Output("measured minus predicted position; NaN at samples without a correction", "m"),
    "innovation_std": Output("standard deviation of the innovation", "m"),
    "rest": Output("move of the vented rest since the calibration", "m"),
    "mismatch": Output("mean square of the innovations over that of the calibration recordings", "1"),
    "strokes": Output("strokes that have ended", ""),
    "flags": Output("flags of the sample, one bit each, in the order of the list", ""),
    "trust": Output("trust in the load so far: 0 none, 1 with care, 2 good", ""),
    "reasons": Output("reasons why trust is below 2, one bit each", ""),
})  # fmt: skip

#: Reasons why trust is below 2: the name of each bit of the output `reasons`.
REASONS: Mapping[str, str] = MappingProxyType({
    "calibration": "the calibration has no vented rest, or the load does not adapt",
    "strokes": "fewer than two strokes have ended",
    "band": "the band of the load from 5 to 8 mm is too wide",
    "mismatch": "the innovations are larger than in the calibration recordings",
    "supply": "no supply pressure is in use",
    "rest": "a vented rest has moved and is kept",
    "zero": "the position jumped and stayed",
    "flags": "flags of the last 20 s, or of the last two strokes",
})  # fmt: skip
