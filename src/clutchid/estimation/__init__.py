"""Estimation of parameters and load from recordings, with uncertainties."""

from clutchid.estimation.result import Change, Errors, Fit, Recording, errors_over
from clutchid.inference.uncertainty.estimates import Estimate, LoadCurve

__all__ = ["Change", "Errors", "Estimate", "Fit", "LoadCurve", "Recording", "errors_over"]
