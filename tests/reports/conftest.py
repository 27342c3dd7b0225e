"""A short fit and what every page must hold to."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable

import pytest

from clutchid import Fit, fit
from clutchid.log import Log

PICTURES = ("data:image/png;base64,", "data:image/svg+xml;base64,")


@pytest.fixture(scope="session")
def fitted(drive: Log, with_noise: Callable[..., Log]) -> Fit:
    """A fit of 4 s with pressure in the log, verified on 3 s without."""
    noisy = with_noise(drive, 1)
    checked = Log(
        noisy.time[6000:9000], {n: noisy[n][6000:9000] for n in noisy.columns if n != "pressure_a"}, "checked"
    )
    first = Log(
        noisy.time[:4000],
        {n: noisy[n][:4000] for n in noisy.columns},
        "first",
        {"sha256": "abc123", "source": "first.csv"},
    )
    return fit(first, verify=[checked])


@pytest.fixture(scope="session")
def loads_nothing() -> Callable[[str], bool]:
    """Whether a page refers to nothing outside itself: every address is data or a place on the page."""

    def check(html: str) -> bool:
        addresses = re.findall(r"(?:src|href|action|data|poster)\s*=\s*[\"']?([^\"'\s>]+)", html)
        outside = [a for a in addresses if not a.startswith((*PICTURES, "#"))]
        text = re.sub(r"base64,[A-Za-z0-9+/=]+", "", html)
        drawings = [base64.b64decode(d).decode() for d in re.findall(r"svg\+xml;base64,([A-Za-z0-9+/=]+)", html)]
        inside = [a for drawing in drawings for a in re.findall(r"(?:href=\"|url\()([^\")]+)", drawing)]
        loaded = re.search(r"https?://|url\(|@import|<script|<link|<iframe", text)
        return not (outside or loaded or [a for a in inside if not a.startswith("#")])

    return check
