"""`Calibration`: what later fits of the same actuator use of a fit with pressure; consider parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from clutchid.inference.uncertainty.change_prior import drift
from clutchid.inference.uncertainty.conditions import NOT_RECORDED, RecordedConditions
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.inference.uncertainty.gaussian import square_root
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.parameters import in_order
from clutchid.strokes.travel import Travel
from clutchid.strokes.vented_rest import VentedRest


@dataclass(frozen=True, slots=True, eq=False)
class PositionOnlyErrors:
    """Errors of fits to position alone of the calibration recordings, relative to the calibration with pressure.

    Where the model errs, such a fit finds another load, and seems to find changes, although nothing has changed. One
    row a hypothesis of `clutchid.inference.uncertainty.change_prior`: only the difference to it is a change.

    Parameters
    ----------
    hypotheses : several groups each
        That were assumed to have changed; the first is none.
    names
        Load weights and parameters that were free.
    shifts : (hypotheses, k)
        Errors of `names`: shares of the value, or in the parameter's unit if it may be 0; load weights in their unit.
    log_evidence : (hypotheses,)
        Logarithm of the evidence.
    dispersion : 1
        See `clutchid.inference.smoother.residuals`.
    misfit : 1/s
        Cost for each second in motion, without a change; NaN if it is not known.
    """

    hypotheses: tuple[tuple[str, ...], ...]
    names: tuple[str, ...]
    shifts: FloatArray
    log_evidence: FloatArray
    dispersion: float = 1.0
    misfit: float = float("nan")

    def shift(self, hypothesis: tuple[str, ...], names: Sequence[str]) -> FloatArray:
        """Errors of `names` under a hypothesis, 0 where they are not known."""
        if hypothesis not in self.hypotheses:
            hypothesis = self.hypotheses[0]
        errors = dict(zip(self.names, self.shifts[self.hypotheses.index(hypothesis)].tolist(), strict=True))
        return np.array([errors.get(name, 0.0) for name in names])

    def evidence(self, hypothesis: tuple[str, ...]) -> float:
        """Logarithm of the evidence of a hypothesis against that of no change; 0 if it is not known."""
        if hypothesis not in self.hypotheses:
            return 0.0
        return float(self.log_evidence[self.hypotheses.index(hypothesis)] - self.log_evidence[0])


class Origin(NamedTuple):
    """Origin of a calibration; what an older file does not say is empty.

    Attributes
    ----------
    name
        Of its file.
    created
        Time of its creation, ISO 8601.
    sha256
        Checksum of the file.
    trust
        Of the calibration: 'good', 'with care' or 'none'.
    """

    name: str = ""
    created: str = ""
    sha256: str = ""
    trust: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Uncertainty and corrections of a calibrated actuator.

    Parameters
    ----------
    names, covariance
        Calibrated parameters and their covariance in SI, shape (k, k). They are fixed in later fits, as consider
        parameters.
    data : {name: hash}
        The calibration recordings.
    method : 'shooting' or 'prediction-error'
        Method of the calibration; the errors of fits to position alone belong to it.
    position_only : PositionOnlyErrors, optional
        Errors of fits to position alone, which are subtracted in later fits; None if there was no pressure.
    theta, theta_covariance
        Calibrated load weights and their covariance in SI, shape (m, m); empty if an older file lacks them.
    converged
        Whether the search of the calibration converged.
    origin : Origin, optional
        Its file, if it is from one.
    conditions : RecordedConditions
        Of the calibration recordings, where the vehicle measures them.
    nis : 1
        Mean normalised innovation squared of an observer of the calibration recordings, NaN if it is not known.
    vented
        Whether a recording shows a settled vented rest, see `clutchid.strokes.vented_pressure`. Without one
        only the prior determines the ambient pressure, and with it the load.
    rest : VentedRest, optional
        Vented rest of the calibration recordings, from which the travel is measured; None without a rest, or in an
        older file.
    travel : Travel, optional
        Of the piston in the calibration recordings; None in an older file.
    missed : N
        Standard deviation of the calibrated load due to errors of the model, at every position; 0 in an older
        file. The band of this load includes it; `theta_covariance` and later fits do not.

    Examples
    --------
    With a prior on the supply pressure, a calibration keeps what the recording left of its uncertainty:

    >>> import clutchid
    >>> log = clutchid.bundled_recording().slice(0, 4000)
    >>> request = clutchid.FitRequest(priors={"P_S": clutchid.Prior(9e5, 5e4)})
    >>> known = clutchid.calibrate(log, request=request, free="load,P_S").calibration
    >>> known.names, bool(10e3 < known.covariance[0, 0] ** 0.5 < 50e3)  # in Pa, less than that of the prior
    (('P_S',), True)
    """

    names: tuple[str, ...]
    covariance: FloatArray
    data: Mapping[str, str] | None = None
    method: str = "shooting"
    position_only: PositionOnlyErrors | None = None
    theta: tuple[float, ...] = ()
    theta_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    converged: bool = True
    origin: Origin | None = None
    conditions: RecordedConditions = NOT_RECORDED
    nis: float = float("nan")
    rest: VentedRest | None = None
    vented: bool = True
    travel: Travel | None = None
    missed: float = 0.0

    def covariance_of(self, names: tuple[str, ...]) -> FloatArray:
        """Covariance of `names`; 0 for those that were not calibrated."""
        at = [self.names.index(name) if name in self.names else -1 for name in names]
        full = np.zeros((len(names), len(names)))
        calibrated = [i for i, place in enumerate(at) if place >= 0]
        places = [at[i] for i in calibrated]
        full[np.ix_(calibrated, calibrated)] = self.covariance[np.ix_(places, places)]
        return full


class ModelMisses(NamedTuple):
    """Errors of a calibrated load that its model makes, as independent standard deviations, alike at every position.

    Attributes
    ----------
    peak : 1
        Share of the peak of the load.
    pressure : 1
        Share of the force of the autocorrelated part of the pressure's residual, which the model does not follow.

    Notes
    -----
    Provenance: `benchmarks/calibration_bands.py`, trucks 3700 to 3715: of the settings whose interval score is as small
    as any on family B and odd hybrids, the one with narrow bands on A; confirmed on trucks 3716 to 3719 of A, B and
    hybrids, run once. benchmarks/results/calibration.md has the figures.
    """

    peak: float = 0.001
    pressure: float = 0.6


MODEL_MISSES = ModelMisses()

#: Factor on all standard deviations of a fit by prediction error; chosen on trucks of the proving ground,
#: docs/truck.md.
DEVIATION_FACTOR = 0.85


def calibrated_deviation(actuator: Actuator, name: str, calibration: Calibration) -> float:
    """Standard deviation in SI of a calibrated parameter in another recording: calibration and drift."""
    return float(np.sqrt(calibration.covariance_of((name,))[0, 0] + drift(actuator, name) ** 2))


def consider_parameters(
    actuator: Actuator, free: Sequence[Coordinate], calibration: Calibration | None
) -> tuple[tuple[Coordinate, ...], FloatArray]:
    """Parameters that are fixed but uncertain (Schmidt 1966), and the square root of their covariance.

    Each is a coordinate with a width of one standard deviation; the root, shape (m, m), contains their correlations.
    """
    free_names = {c.base for c in free} | set(actuator.load.names)
    calibrated = calibration.names if calibration else ()
    drifting = in_order(actuator.rows, lambda row: row.drift)
    names = tuple(n for n in dict.fromkeys([*drifting, *calibrated]) if n not in free_names)
    matrix = np.diag([drift(actuator, name) ** 2 for name in names])
    if calibration:
        matrix = matrix + calibration.covariance_of(names)
    width = np.sqrt(np.diag(matrix))
    uncertain = [i for i in range(len(names)) if 0.0 < width[i] < np.inf]
    considered = []
    for i in uncertain:
        row = actuator.row(names[i])
        value = actuator.value(names[i])
        considered.append(Coordinate(names[i], None, value, float(width[i]), False, row.low, row.high))
    correlation = matrix[np.ix_(uncertain, uncertain)] / np.outer(width[uncertain], width[uncertain])
    return tuple(considered), square_root(correlation)
