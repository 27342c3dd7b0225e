"""A fit that tests of estimation judge and change."""

import pytest

from clutchid import fit


@pytest.fixture(scope="session")
def short_fit(drive, with_noise):
    """A fit of 4 s by the model that made them."""
    return fit(with_noise(drive, 1).slice(0, 4000))
