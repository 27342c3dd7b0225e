"""A valve whose dead band is as wide as its full opening: refused in a file, never reached by a search."""

import pytest

from clutchid import fit
from clutchid.errors import ParameterError


@pytest.mark.parametrize("valve", ["vs", "ve"])
def test_a_search_whose_bounds_let_both_ends_meet_keeps_them_apart(valve, truth, drive):
    names = (f"R_0{valve}", f"R_1{valve}")
    near = truth.replace({names[0]: 0.49, names[1]: 0.5})
    result = fit(drive, near, free=names, bounds={names[0]: (0.0, 1.0), names[1]: (0.05, 2.0)})
    low, high = (result.actuator.value(name) for name in names)
    assert result.status != "failed"
    assert low < high


def test_bounds_that_start_a_search_with_the_ends_exchanged_are_refused(truth, drive):
    with pytest.raises(ParameterError, match=r"R_0vs = 0.6 must be below R_1vs = 0.5"):
        fit(drive, truth, free=("R_0vs", "R_1vs"), bounds={"R_0vs": (0.6, 0.9), "R_1vs": (0.3, 0.5)})
