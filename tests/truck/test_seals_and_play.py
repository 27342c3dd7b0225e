"""Friction of family B: passive, bounded, with the limits of its elements; play; grease."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from clutchid.truck.equations import slip as friction
from clutchid.truck.equations.slip import LIMIT, STIFFNESS

_v, _z, _K, _W, _b = sp.symbols("v z K W b", real=True)
slip_rate = sp.lambdify((_v, _z, _K, _W), friction.slip_rate(_v, _z, _K, _W), "math")
slip_force = sp.lambdify((_z, _K, _W), friction.slip_force(_z, _K, _W), "math")
bristle_rate = sp.lambdify((_v, _z, _K, _W, _b), friction.bristle_rate(_v, _z, _K, _W, _b), "math")
speed, stiffness, limit = st.floats(-0.4, 0.4), st.floats(1e5, 1.3e6), st.floats(30, 600)


@given(speed, st.floats(-3, 3), stiffness, limit)
def test_a_slipping_element_never_gives_more_energy_than_it_stores(v, share, K, W):
    z = share * W / K
    taken = slip_force(z, K, W) * v - K * z * slip_rate(v, z, K, W)
    # passive up to the speed at which the deflection beyond the limit outruns the limit itself
    if abs(v) <= W / (K * friction.SLIP_TIME):
        assert taken >= -1e-9 * W
    assert abs(slip_force(z, K, W)) <= W


@given(speed, st.floats(-1.5, 1.5), stiffness, st.floats(80, 600), st.floats(0.5, 0.8), st.floats(0, 1200))
def test_bristles_never_give_more_energy_than_they_store(v, share, K, g, x_b, D):
    z = share * g / K
    rate = bristle_rate(v, z, K, g, x_b)
    force = float(friction.bristle_force(z, rate, v, K, D, 0.02))
    assert force * v - K * z * rate >= -1e-9 * g


def pushed(path: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Force of the Maxwell slip elements of the seals (1 MN/m, 200 N) along a path in m, one value a step."""
    z, out = np.zeros(4), []
    for v in np.diff(path) / step:
        for i, (k, w) in enumerate(zip(STIFFNESS, LIMIT, strict=True)):
            z[i] += step * slip_rate(v, z[i], k * 1e6, w * 200.0)
        out.append(
            sum(slip_force(z[i], k * 1e6, w * 200.0) for i, (k, w) in enumerate(zip(STIFFNESS, LIMIT, strict=True)))
        )
    return np.array(out)


def test_maxwell_slip_follows_its_virgin_curve_and_returns_along_the_same_curve_twice_as_large():
    def virgin(x):
        return sum(min(k * 1e6 * x, w * 200.0) for k, w in zip(STIFFNESS, LIMIT, strict=True))

    up = np.linspace(0, 1e-3, 20001)
    force = pushed(np.concatenate([up, up[-2::-1]]))
    for x in (5e-5, 1.2e-4, 2e-4, 5e-4, 1e-3):
        # v tau = 1 um beyond the limit of the elements that slip, 1 MN/m in all
        assert force[np.searchsorted(up, x) - 1] == pytest.approx(virgin(x), abs=1.0)
    for back in (5e-5, 1.5e-4, 4e-4):
        there = 20000 + round(back / 5e-8) - 1
        assert force[there] == pytest.approx(virgin(1e-3) - 2 * virgin(back / 2), abs=2.0)
    assert sum(STIFFNESS) == pytest.approx(1)
    assert sum(LIMIT) == pytest.approx(1)


def test_bristles_do_not_drift_under_a_small_swinging_force_but_slide_under_a_large_one():
    t = np.arange(0, 2, 1e-4)
    for amplitude, drifts in ((0.5, False), (1.3, True)):
        z = 0.0
        for v in np.gradient(amplitude * 2e-4 * np.sin(2 * np.pi * t), t):
            z += 1e-4 * bristle_rate(v, z, 1e6, 200.0, 0.6)
        # what is left of the deflection after two whole swings; Euler's error is 1e-4 * 2 pi of the amplitude at most
        assert (abs(z) > 3e-6) == drifts
    assert bristle_rate(0.1, 2e-4, 1e6, 200.0, 0.6) == pytest.approx(0, abs=1e-12)
    assert bristle_rate(-0.1, 2e-4, 1e6, 200.0, 0.6) == -0.1


def test_pressure_on_the_lips_saturates():
    def lip(p):
        return float(friction.lip_force(p, 1e5, 100.0, 80.0, 3e5))

    assert [lip(1e5), lip(4e5)] == pytest.approx([100, 140])
    assert lip(1e9) == pytest.approx(180, abs=0.1)


def test_stiction_falls_to_coulomb_friction():
    def steady(v):
        return float(friction.breakaway_force(v, 200.0, 1.4, 0.01))

    assert [steady(0.0), steady(-0.01), steady(1.0)] == pytest.approx([280, 200 * (1 + 0.4 / math.e), 200])


def test_grease_is_about_twice_as_thick_at_minus_30_and_half_at_80_degrees_and_thins_under_shear():
    for T_V, B in ((100.0, 220.0), (140.0, 340.0), (120.0, 300.0)):
        cold, hot = (float(friction.grease_viscosity(T, 293.15, T_V, B)) for T in (243.15, 353.15))
        assert 1.4 < cold < 4.5
        assert 0.4 < hot < 0.8
    assert float(friction.grease_force(-0.5, 3000.0, 1.0)) == pytest.approx(-1000)
