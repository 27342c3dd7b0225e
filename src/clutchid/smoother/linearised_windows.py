"""What the windows of a track say, side by side: their rows, and how these go along with a small step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.smoother.window_rows import Rows


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedWindows:
    """The `Rows` of all windows of a track; the first axis is that of the windows.

    Where theta is held there are no columns for it.
    """

    own: FloatArray
    r: FloatArray
    end: FloatArray
    to_start: FloatArray
    to_theta: FloatArray
    cost: FloatArray

    @classmethod
    def by(cls, windows: Sequence[Rows]) -> LinearisedWindows:
        """What `windows` say; rows that one has less than another are zero."""
        width = windows[0].own.shape[1]
        padded = np.zeros((len(windows), width, width))
        for place, rows in enumerate(windows):
            padded[place, : rows.own.shape[0]] = rows.own
        end, to_start, to_theta = (
            np.array([getattr(rows, name) for rows in windows]) for name in ("end", "to_start", "to_theta")
        )
        cost = np.array([rows.cost for rows in windows])
        return cls(padded[:, :, :-1], padded[:, :, -1], end, to_start, to_theta, cost)

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.end.shape[1])

    @property
    def of_states(self) -> FloatArray:
        """Rows ``[state | theta | r]`` that tell of the starts, shape (windows, n, n + k + 1)."""
        n = self.states
        return np.concatenate([self.own[:, :n], self.r[:, :n, None]], axis=2)

    @property
    def of_theta(self) -> FloatArray:
        """Rows ``[theta | r]`` of all windows that tell of theta alone."""
        n = self.states
        rows = np.concatenate([self.own[:, n:, n:], self.r[:, n:, None]], axis=2)
        return rows.reshape(-1, rows.shape[2])

    def moved(self, starts: FloatArray, step: FloatArray) -> LinearisedWindows:
        """What these rows say where the starts move by `starts` (windows, n), in units, and theta by `step`."""
        both = np.column_stack([starts, np.broadcast_to(step, (starts.shape[0], step.size))])
        r = self.r + np.einsum("wij,wj->wi", self.own, both)
        end = self.end + np.einsum("wij,wj->wi", self.to_start, starts) + self.to_theta @ step
        return replace(self, r=r, end=end, cost=self.cost + np.sum(r**2 - self.r**2, axis=1))

    def states_only(self) -> LinearisedWindows:
        """The same with theta held: only what tells of the starts."""
        n = self.states
        return replace(self, own=self.own[:, :n, :n], r=self.r[:, :n], to_theta=self.to_theta[:, :, :0])

    def renewed(self, places: NDArray[np.intp], new: LinearisedWindows) -> LinearisedWindows:
        """The same with the windows `places` as in `new`."""
        height = self.own.shape[1]

        def of(old: FloatArray, other: FloatArray) -> FloatArray:
            both = old.copy()
            both[places] = other
            return both

        return LinearisedWindows(
            of(self.own, new.own[:, :height]),
            of(self.r, new.r[:, :height]),
            of(self.end, new.end),
            of(self.to_start, new.to_start),
            of(self.to_theta, new.to_theta),
            of(self.cost, new.cost),
        )
