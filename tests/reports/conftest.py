"""A short fit and what every page must hold to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from clutchid import Fit, fit
from clutchid.log import Log


@pytest.fixture(scope="session")
def fitted(drive: Log, with_noise: Callable[..., Log]) -> Fit:
    """A fit of 4 s with pressure in the log, verified on 3 s without."""
    noisy = with_noise(drive, 1)
    checked = replace(noisy.slice(6000, 9000).without("pressure_a"), name="checked")
    origin = {"sha256": "abc123", "source": "first.csv"}
    return fit(replace(noisy.slice(0, 4000), name="first", metadata=origin), verify=[checked])
