"""The band of a load that is read from position alone: drift enters through the load it makes, and it is honest."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.method import fit_at
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.inference.smoother import search as fine_search
from clutchid.inference.smoother.search import search
from clutchid.inference.uncertainty import calibration
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import changeable, drift
from clutchid.parameters import Parameters

#: Parameters whose drift is not estimated.
CONSIDERED = ("A_A", "P_0", "m_ve")

pytestmark = pytest.mark.slow

#: All numbers but the load are known as well as they drift.
EXACT = Calibration((), np.zeros((0, 0)))

#: Standard deviations of a 95 % interval.
QUANTILE = 1.96


def half_width(fit, y):
    return np.interp(y, fit.load_curve.position, fit.load_curve.high - fit.load_curve.force)


def test_the_band_counts_the_load_that_a_drift_of_the_area_makes(plant, worn_log, monkeypatch):
    y = np.linspace(1e-3, 20e-3, 20)
    shot = shoot([worn_log], plant, FreeParameters(plant.load.names, ("position",)), EXACT)
    whole = half_width(fit_at(SHOOTING, shot, EXACT), y)
    monkeypatch.setattr(calibration, "drift", lambda actuator, name: 0.0 if name == "A_A" else drift(actuator, name))
    counted = np.sqrt(whole**2 - half_width(fit_at(SHOOTING, shot, EXACT), y) ** 2)
    # the same by searching at 1 % more and less, to within sqrt(1e-4) = 0.01 standard deviations of the minimum
    monkeypatch.setattr(fine_search, "CONVERGED_GAIN", 1e-4)
    problem, solution = shot.problem, shot.solution
    loads = []
    area = plant.value("A_A")
    for share in (1.01, 0.99):
        off = replace(problem, actuator=problem.actuator.replace({"A_A": share * area}))
        again = search(off, solution.x, solution.at.X, (1.0,))
        loads.append(problem.actuator_of(again.x, "worn").load.force(y))
    by_share = np.abs(loads[0] - loads[1]) / 0.02
    # two searches each end within 0.01 of 45 N, where the loads differ by 56 N
    assert counted == pytest.approx(QUANTILE * Parameters.row("A_A").drift.std * by_share, rel=0.02)


def test_where_errors_last_as_long_as_assumed_the_band_of_the_load_is_as_wide_as_they_are(worn, plant, recorded_by):
    recordings, spread, directions = 3, 0.0, 0.0
    for seed in range(recordings):
        rng = np.random.default_rng(seed)
        # an actuator that differs from the calibrated one as far as it may
        drifted = {n: worn.value(n) + drift(worn, n) * rng.standard_normal() for n in (*changeable(worn), *CONSIDERED)}
        true = worn.replace({**drifted, "C_A0": abs(drifted["C_A0"])})  # a leak is not below 0
        clean = recorded_by(true, seconds=4.0, seed=None, name="w", driven=1).without("pressure_a")
        # 50 µm whose neighbours correlate at 9/11, so that (1 + 9/11) / (1 - 9/11) = 10 samples, 10 ms, tell as one
        error = lfilter([np.sqrt(1.0 - (9 / 11) ** 2)], [1.0, -9 / 11], rng.standard_normal(len(clean)))
        log = clean.with_columns(position=clean["position"] + 5e-5 * error)
        fit = fit_with(SHOOTING, [log], plant, FitRequest(("position",), ("load",), calibration=EXACT))
        y = np.linspace(0.5e-3, 20e-3, 40)
        miss = fit.actuator.load.force(y) - true.load.force(y)
        spread += np.mean((QUANTILE * miss / half_width(fit, y)) ** 2) / recordings
        # neighbouring points of a curve are wrong together: as many independent directions as the covariance has
        phi = fit.actuator.load.phi(y)
        covariance = phi @ fit.covariance[: phi.shape[1], : phi.shape[1]] @ phi.T
        deviation = np.sqrt(np.diag(covariance))
        directions += y.size**2 / np.sum((covariance / np.outer(deviation, deviation)) ** 2)
    # a mean of squares of so many standard deviations
    low, high = chi2.ppf([0.001, 0.999], directions) / directions
    assert low < spread < high
