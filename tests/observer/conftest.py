"""A worn actuator, its recording, and an observer that starts from the load of the new one."""

import pytest

from clutchid.observer import observer


@pytest.fixture(scope="package")
def worn(plant):
    """The actuator of the recording: the load is a tenth larger than the one that an observer starts from."""
    return plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names})


@pytest.fixture(scope="package")
def log(worn, recorded_by):
    return recorded_by(worn, seconds=6.0)


@pytest.fixture(scope="package")
def joint(plant):
    return observer(plant)
