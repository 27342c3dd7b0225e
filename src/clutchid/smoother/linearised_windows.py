"""Linearised windows of a track, stacked, and their first-order extrapolation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.smoother.window_rows import WindowRows


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedWindows:
    """The `WindowRows` of all windows of a track; the first axis is the window.

    With fixed theta there are no columns for it.
    """

    jacobian: FloatArray
    r: FloatArray
    end: FloatArray
    to_start: FloatArray
    to_theta: FloatArray
    cost: FloatArray

    @classmethod
    def stack(cls, windows: Sequence[WindowRows]) -> LinearisedWindows:
        """Stack `windows`; missing rows are zero."""
        width = windows[0].rows.shape[1]
        padded = np.zeros((len(windows), width, width))
        for place, window in enumerate(windows):
            padded[place, : window.rows.shape[0]] = window.rows
        end, to_start, to_theta = (
            np.array([getattr(window, name) for window in windows]) for name in ("end", "to_start", "to_theta")
        )
        cost = np.array([window.cost for window in windows])
        return cls(padded[:, :, :-1], padded[:, :, -1], end, to_start, to_theta, cost)

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.end.shape[1])

    @property
    def state_rows(self) -> FloatArray:
        """Rows ``[state | theta | r]`` that depend on the initial states, shape (windows, n, n + k + 1)."""
        n = self.states
        return np.concatenate([self.jacobian[:, :n], self.r[:, :n, None]], axis=2)

    @property
    def theta_rows(self) -> FloatArray:
        """Rows ``[theta | r]`` of all windows that depend on theta alone."""
        n = self.states
        rows = np.concatenate([self.jacobian[:, n:, n:], self.r[:, n:, None]], axis=2)
        return rows.reshape(-1, rows.shape[2])

    def extrapolated(self, starts: FloatArray, step: FloatArray) -> LinearisedWindows:
        """Residuals, end and cost after a step of the initial states, (windows, n) in natural sizes, and of theta."""
        both = np.column_stack([starts, np.broadcast_to(step, (starts.shape[0], step.size))])
        r = self.r + np.einsum("wij,wj->wi", self.jacobian, both)
        end = self.end + np.einsum("wij,wj->wi", self.to_start, starts) + self.to_theta @ step
        return replace(self, r=r, end=end, cost=self.cost + np.sum(r**2 - self.r**2, axis=1))

    def states_only(self) -> LinearisedWindows:
        """The rows that depend on the initial states, with theta fixed."""
        n = self.states
        return replace(self, jacobian=self.jacobian[:, :n, :n], r=self.r[:, :n], to_theta=self.to_theta[:, :, :0])

    def updated(self, places: NDArray[np.intp], new: LinearisedWindows) -> LinearisedWindows:
        """The windows with those at `places` replaced by `new`."""
        height = self.jacobian.shape[1]

        def replaced(old: FloatArray, other: FloatArray) -> FloatArray:
            both = old.copy()
            both[places] = other
            return both

        return LinearisedWindows(
            replaced(self.jacobian, new.jacobian[:, :height]),
            replaced(self.r, new.r[:, :height]),
            replaced(self.end, new.end),
            replaced(self.to_start, new.to_start),
            replaced(self.to_theta, new.to_theta),
            replaced(self.cost, new.cost),
        )
