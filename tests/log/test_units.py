"""Units: typed again as factors, gauge apart from absolute."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.log.units import UNITS, known_units, to_si

AMBIENT = 1.095e5
# one of each unit in SI
ONE = {
    "s": 1, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "100ns": 1e-7, "min": 60, "h": 3600, "d": 86400,
    "m": 1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6,
    "µm": 1e-6, "1": 1, "%": 1e-2, "m/s": 1, "mm/s": 1e-3,
    "N": 1, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "µN": 1e-6, "K": 1, "degC": 274.15, "°C": 274.15, "Pa": 1, "hPa": 100,
    "kPa": 1000, "MPa": 1e6, "mbar": 100, "bar": 1e5, "psi": 6894.757293168361, "Pa(g)": 1 + AMBIENT,
    "hPa(g)": 100 + AMBIENT, "kPa(g)": 1000 + AMBIENT, "MPa(g)": 1e6 + AMBIENT, "mbar(g)": 100 + AMBIENT,
    "bar(g)": 1e5 + AMBIENT, "psi(g)": 6894.757293168361 + AMBIENT,
}  # fmt: skip


@pytest.mark.parametrize("name", ONE)
def test_one_of_a_unit_in_si(name):
    assert to_si(np.array([1.0]), name, UNITS[name].si, AMBIENT)[0] == pytest.approx(ONE[name], rel=1e-15)


def test_no_unit_is_untested():
    assert set(UNITS) == set(ONE)


def test_a_pound_per_square_inch_is_4_448_newton_on_25_4_millimetres_squared():
    assert to_si(np.ones(1), "psi", "Pa", AMBIENT)[0] == pytest.approx(4.4482216152605 / 0.0254**2, rel=1e-14)


def test_gauge_pressure_is_above_the_ambient_that_is_given():
    assert to_si(np.array([0.0, 7.9]), "bar(g)", "Pa", 1.0e5).tolist() == pytest.approx([1.0e5, 8.9e5])
    assert all(unit.gauge == name.endswith("(g)") for name, unit in UNITS.items())


def test_missing_samples_stay_missing():
    assert np.isnan(to_si(np.array([np.nan]), "mm", "m", AMBIENT)[0])


def test_values_in_si_are_not_copied():
    values = np.arange(3.0)
    assert to_si(values, "Pa", "Pa", AMBIENT) is values


@pytest.mark.parametrize(("name", "si"), [("inch", "m"), ("bar", "m"), ("kPag", "Pa"), ("", "s")])
def test_an_unknown_or_foreign_unit_is_refused_with_the_known_ones(name, si):
    with pytest.raises(DataError) as caught:
        to_si(np.zeros(1), name, si, AMBIENT)
    assert f"unit [{name}] is not known here; use one of {', '.join(known_units(si))}." in str(caught.value)
