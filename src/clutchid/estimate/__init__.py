"""Estimation of parameters and load from recordings, with uncertainties."""

from clutchid.estimate.fit import fit
from clutchid.estimate.result import Estimate, Fit, LoadCurve

__all__ = ["Estimate", "Fit", "LoadCurve", "fit"]
