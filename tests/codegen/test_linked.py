"""Named tuples that kernels take by address, and kernels that are parts of others."""

import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core import event

from clutchid.codegen.kernels import kernel
from clutchid.codegen.linked import by_address


class Inner(NamedTuple):
    """Arrays of two dimensions and a number."""

    matrix: Any
    count: int


class Outer(NamedTuple):
    """A record in a record, and tuples and arrays of several types."""

    share: float
    inner: Inner
    places: Any
    pair: tuple[Any, Any]


by_address(Outer)


def outer():
    places = np.arange(3)
    return Outer(0.5, Inner(np.arange(6.0).reshape(2, 3), 7), places, (np.ones(2), np.full(4, 3.0)))


@kernel
def last_row(inner, out):
    for c in range(inner.matrix.shape[1]):
        out[c] = inner.matrix[1, c] * inner.count


@kernel
def read(record, out):
    a, b = record.pair
    last_row(record.inner, out)
    out[3] = record.share * a.size + b[3] + record.places[2]
    record.inner.matrix[0, 0] = -1.0


@pytest.fixture
def results():
    record, out = outer(), np.empty(4)
    read(record, out)
    return record, out


def test_a_kernel_reads_the_fields_of_a_record_and_changes_what_its_arrays_hold(results):
    record, out = results
    np.testing.assert_array_equal(out, [21.0, 28.0, 35.0, 6.0])
    assert record.inner.matrix[0, 0] == -1.0


def test_a_kernel_leaves_as_many_references_to_the_arrays_of_a_record_as_there_were(results):
    record, out = results
    arrays = (record.inner.matrix, record.places, *record.pair, out)
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(10):
        read(record, out)
    assert [sys.getrefcount(array) for array in arrays] == before


class Compilations(event.Listener):
    """Names of the kernels that are compiled."""

    def __init__(self):
        self.names = []

    def on_start(self, begins):
        self.names.append(begins.data["dispatcher"].py_func.__name__)

    def on_end(self, _):
        pass


def test_a_kernel_is_compiled_once_for_a_literal_and_a_variable_of_its_type():
    @kernel
    def doubled(x, wanted):
        return 2.0 * x if wanted else x

    @kernel
    def both(x):
        return doubled(x, False) + doubled(x, x > 0.0)

    compilations = Compilations()
    with event.install_listener("numba:compile", compilations):
        assert both(3.0) == 9.0
    assert compilations.names == ["both", "doubled"]
