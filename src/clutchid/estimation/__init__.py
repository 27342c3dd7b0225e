"""Estimation of parameters and load from recordings, with uncertainties."""

from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.estimates import Estimate, LoadCurve

__all__ = ["Estimate", "Fit", "LoadCurve"]
