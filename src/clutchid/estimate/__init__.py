"""Fitting recordings: bounded least squares on simulation errors, with honest standard errors."""

from clutchid.estimate.fit import fit
from clutchid.estimate.result import Estimate, Fit, LoadCurve

__all__ = ["Estimate", "Fit", "LoadCurve", "fit"]
