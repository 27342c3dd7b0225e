"""Recordings and problems of the filter, and its kernels."""

import pytest

from clutchid.codegen.kernels import kernels_in
from fixtures.filter_recordings import duties, plant, problem_of, recorded_by  # noqa: F401
from fixtures.filters import callbacks, linear_step


@pytest.fixture(scope="package")
def kernels():
    return kernels_in("clutchid.inference.filter.recursion")


@pytest.fixture(scope="package")
def calls():
    """The functions of the linear model."""
    return callbacks(linear_step)
