"""The manoeuvre that would tell most about the free parameters: D-optimal over those of the virtual truck."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.errors import ParameterError, SolveError
from clutchid.estimate.simulation_error.problem import problem
from clutchid.log import FloatArray, Log
from clutchid.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import triangular
from clutchid.parameters import unknown_name
from clutchid.simulation.partition import Partition
from clutchid.simulation.simulation import Simulation, simulate

#: Samples of 1 ms after which the simulation takes the position again, so that a wrong model stays near the recording.
EVERY = 200

#: Time in s over which residuals forget: a part between two resets then has the say of two to three samples.
MEMORY = 0.1

#: Below this shrinking of the worst standard error another recording is not worth the drive.
WORTH_DRIVING = 0.9

_FRACTIONS = ((1 / 2, "half"), (1 / 3, "a third"), (1 / 4, "a quarter"), (1 / 5, "a fifth"), (1 / 10, "a tenth"))


@dataclass(frozen=True, slots=True)
class Gain:
    """What a manoeuvre would add: information in nats, and standard errors in SI with it.

    `shrinks_to` is what remains of the worst standard error, as a part of what it was; `reach` in m.
    """

    manoeuvre: str
    nats: float
    shrinks_to: float
    errors: Mapping[str, float]
    reach: float


@dataclass(frozen=True, slots=True)
class Proposal:
    """The manoeuvre to drive, the reason in words, and what each would bring, the best first.

    `errors` are the standard errors in SI as they are now; `worst` names the one that is largest beside the natural
    size of its parameter. `warnings` name manoeuvres that could not be simulated.
    """

    manoeuvre: str
    seconds: float
    message: str
    worst: str
    errors: Mapping[str, float]
    gains: tuple[Gain, ...]
    warnings: tuple[str, ...] = ()


def best_manoeuvre(
    actuator: Actuator,
    names: Sequence[str],
    R: FloatArray | None = None,
    seconds: float = 10.0,
    *,
    measure: Sequence[str] = ("position",),
    scales: Mapping[str, float] | None = None,
    memory: float = MEMORY,
) -> Proposal:
    r"""The manoeuvre that adds most information about `names`.

    .. math:: \max_m \; \tfrac12 \log \det \big(R^T R + R_m^T R_m + I\big)

    Parameters
    ----------
    actuator : Actuator
        The fitted one; any variant and basis.
    names : names
        Free parameters and load weights.
    R : (k, k), optional
        Factor of the information so far, for the numbers in the units of `clutchid.estimate.simulation_error.problem`,
        the first of which are `names`; further ones (unknown starts) are left open. A factor made as if residuals were
        white is to be multiplied by the root of effective over counted samples, see `clutchid.assess.diagnostics`.
    seconds : s
        Length of each manoeuvre.
    measure : 'position', 'pressure_a'
        What would be measured.
    scales : {name: m or Pa}, optional
        Noise scales of the residuals, by default those of the first stage of a fit.
    memory : s
        Time over which residuals forget; 0 for white ones.

    Returns
    -------
    proposal : Proposal

    Raises
    ------
    ParameterError
        For an unknown name, none at all, an `R` that does not fit them, or an impossible length.
    SolveError
        If no manoeuvre can be simulated.

    Notes
    -----
    I is a weak prior, one natural size of each number: what no manoeuvre tells then counts alike for all. Residuals
    are taken as a first-order autoregression that starts anew at each reset, and sensitivities are whitened with it.

    Examples
    --------
    >>> proposal = best_manoeuvre(Actuator(), ("theta_1", "theta_3"), seconds=5.0)
    >>> proposal.gains[0].nats >= proposal.gains[-1].nats > 0.0
    True
    """
    from clutchid.truck import MANOEUVRES, Truck, drive

    _check(actuator, names, R, measure, memory)
    unit = _units(actuator, names)
    noise = {name: float(scales[name]) if scales else MEASURED[name].first_scale for name in measure}
    prior = np.vstack([np.eye(len(names)), np.zeros((0, len(names))) if R is None else _shared(R, len(names))])
    now = _standard_errors(prior)
    worst = int(np.argmax(now))
    gains, warnings = [], []
    for manoeuvre in MANOEUVRES:
        log = drive(Truck(), manoeuvre=manoeuvre, seconds=seconds, name=manoeuvre).log
        done = simulate(
            actuator, log, partition=Partition(every=EVERY), sensitivities=tuple(names), on_failure="return"
        )
        if done.status == "failed":
            warnings.append(f"'{manoeuvre}' is left out: {done.message}")
            continue
        factor = np.vstack([prior, *_information(done, actuator, unit, noise, memory)])
        then = _standard_errors(factor)
        nats, reach = _log_det(factor) - _log_det(prior), float(np.nanmax(log["position"]))
        errors = dict(zip(names, (then * unit).tolist(), strict=True))
        gains.append(Gain(manoeuvre, nats, float(then[worst] / now[worst]), errors, reach))
    if not gains:
        raise SolveError("no manoeuvre can be simulated with this actuator. " + " ".join(warnings))
    gains.sort(key=lambda gain: -gain.nats)
    message = _message(gains, names[worst], seconds, R is not None)
    return Proposal(
        gains[0].manoeuvre, seconds, message, names[worst], dict(zip(names, (now * unit).tolist(), strict=True)),
        tuple(gains), tuple(warnings),
    )  # fmt: skip


def _check(
    actuator: Actuator, names: Sequence[str], R: FloatArray | None, measure: Sequence[str], memory: float
) -> None:
    problems = [unknown_name(name, actuator.names) for name in names if name not in actuator.names]
    problems += [unknown_name(name, MEASURED, "measured column") for name in measure if name not in MEASURED]
    if not names or not measure:
        problems.append("names and measure: at least one free parameter and one measured column are needed.")
    if R is not None and (R.ndim != 2 or R.shape[1] < len(names) or not np.isfinite(R).all()):
        problems.append(f"R has shape {R.shape}: a finite matrix with {len(names)} columns or more is needed.")
    if not memory >= 0.0:
        problems.append(f"memory = {memory:g} s: at least 0 is needed.")
    if problems:
        raise ParameterError("\n".join(problems))


def _units(actuator: Actuator, names: Sequence[str]) -> FloatArray:
    """Natural sizes in SI, the same as in a fit."""
    return problem(actuator, (), names, ("position",), dict.fromkeys(names, (-np.inf, np.inf))).unit


def _shared(R: FloatArray, count: int) -> FloatArray:
    """Information about the first `count` numbers of R when the others are unknown."""
    others = R.shape[1] - count
    factor = triangular(np.column_stack([R[:, count:], R[:, :count]]))
    return factor[others:, others:]


def _information(
    done: Simulation, actuator: Actuator, unit: FloatArray, noise: Mapping[str, float], memory: float
) -> Iterator[FloatArray]:
    """Triangular factor of the whitened sensitivities for each measured column."""
    log: Log = done.log
    stride = float(np.median(np.diff(log.time)))
    rho = np.exp(-stride / memory) if memory > 0.0 else 0.0
    begins = np.zeros(len(log), dtype=bool)
    begins[[0, *Partition(every=EVERY).resets(len(log))]] = True
    for name, scale in noise.items():
        state = actuator.states.index(MEASURED[name].state)
        J = np.column_stack([s[:, state] for s in done.sensitivities.values()]) * unit / scale
        white = np.empty_like(J)
        white[1:] = (J[1:] - rho * J[:-1]) / np.sqrt(1 - rho**2)
        white[begins] = J[begins]
        yield triangular(white[np.all(np.isfinite(white), axis=1)])


def _standard_errors(factor: FloatArray) -> FloatArray:
    """Standard errors from the rows of a Jacobian, in natural sizes; the prior in it keeps them finite."""
    inverse = np.linalg.inv(triangular(factor))
    result: FloatArray = np.sqrt(np.sum(inverse**2, axis=1))
    return result


def _log_det(factor: FloatArray) -> float:
    """Half the logarithm of the determinant of the information."""
    return float(np.sum(np.log(np.abs(np.diag(triangular(factor))))))


def _message(gains: Sequence[Gain], worst: str, seconds: float, known: bool) -> str:
    best = gains[0]
    drive = f"drive '{best.manoeuvre}' for {seconds:g} s"
    if not known:
        over = f", {best.nats - gains[-1].nats:.1f} nats more than '{gains[-1].manoeuvre}'" if len(gains) > 1 else ""
        return f"{drive}: of {len(gains)} manoeuvres it tells most{over}."
    if best.shrinks_to > WORTH_DRIVING:
        return (
            f"no manoeuvre of {seconds:g} s settles {worst}: with the best, '{best.manoeuvre}', its standard error "
            f"stays at {100 * best.shrinks_to:.0f} % of what it is."
        )
    return f"{drive}: the standard error of {worst} shrinks to {_fraction(best.shrinks_to)}."


def _fraction(part: float) -> str:
    """A part in words where a simple fraction is within a tenth of it, else in %."""
    near = [word for value, word in _FRACTIONS if abs(part / value - 1) <= 0.1]
    return near[0] if near else f"{100 * part:.0f} %" if part >= 0.01 else "less than 1 %"
