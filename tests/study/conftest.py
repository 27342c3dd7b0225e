"""The study on the bundled recording, done once for all tests."""

from __future__ import annotations

import pytest

from clutchid.log import Log
from clutchid.study import PaperStudy, halves, paper_study


@pytest.fixture(scope="session")
def logs() -> tuple[Log, Log]:
    """First and second half of the bundled recording."""
    return halves()


@pytest.fixture(scope="session")
def heard() -> list[tuple[str, float]]:
    """What the progress callback of `study` was told."""
    return []


@pytest.fixture(scope="session")
def study(logs, heard, tmp_path_factory) -> PaperStudy:
    """The study of the two halves, with the paper as printed."""
    return paper_study(
        *logs, tmp_path_factory.mktemp("study") / "new" / "out", lambda *told: heard.append(told), literal=True
    )
