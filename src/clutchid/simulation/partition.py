"""Partitioned ballistic simulation: resets to the measured position, in the two definitions of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from clutchid.arguments import check_fields
from clutchid.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Partition:
    """Times at which the simulation is reset to the measured position, and what is conserved at a reset.

    Parameters
    ----------
    every : int, optional
        Re-initialise after every n-th sample ("after each N-th simulation step", Section 3.1).
    parts : int, optional
        Re-initialise at the starts of N equal parts ("the number of partitions of the data set", Section 3.2).
    carry : 'p' or 'q'
        Carry the pressures (the paper) or the masses of air, q = p V.
    take : 'all' or 'position'
        Reset to all measurements that a fit compares, or to the position alone. With
        ``every=1, carry="q", take="position"`` the measured position is an input, and only the air is simulated, see
        docs/actuators.md.

    Raises
    ------
    ParameterError
        If both or neither of `every` and `parts` are given, or one is below 1.

    Examples
    --------
    >>> Partition(parts=4).resets(1000)
    array([250, 500, 750])
    """

    every: int | None = None
    parts: int | None = None
    carry: Literal["p", "q"] = "p"
    take: Literal["all", "position"] = "all"

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.every is None) == (self.parts is None):
            raise ParameterError(f"every = {self.every}, parts = {self.parts}: give exactly one of the two.")
        for name, value in (("every", self.every), ("parts", self.parts)):
            if value is not None and value < 1:
                raise ParameterError(
                    f"{name} = {value}: a number of {'samples' if name == 'every' else 'parts'} is at least 1."
                )
        if self.carry not in ("p", "q"):
            raise ParameterError(f"carry = {self.carry!r}: 'p' carries the pressures, 'q' the masses of air.")
        if self.take not in ("all", "position"):
            raise ParameterError(f"take = {self.take!r}: 'all' compared measurements, or 'position' alone.")

    def resets(self, n: int) -> NDArray[np.int64]:
        """Samples of a recording of `n` samples at which a new part starts; the first sample is not one."""
        if self.every is not None:
            return np.arange(self.every, n, self.every, dtype=np.int64)
        assert self.parts is not None
        starts = np.round(np.arange(1, self.parts) * (n / self.parts)).astype(np.int64)
        return np.unique(starts[(starts > 0) & (starts < n)])
