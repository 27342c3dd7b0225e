"""The most informative manoeuvre for the free parameters: D-optimal over those of the virtual truck."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.errors import ParameterError, SolveError
from clutchid.inference.uncertainty.identifiability import listed
from clutchid.inference.uncertainty.information import Information, natural_sizes
from clutchid.log import FloatArray, Log, sample_interval
from clutchid.log.measured import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.partition import Partition
from clutchid.simulation.simulation import Simulation, simulate

#: Interval between resets to the position in samples of 1 ms, so that a wrong model stays close to the recording.
RESET_SAMPLES = 200

#: Correlation time of the residuals in s: the part between two resets then has the information of two to three samples.
MEMORY = 0.1

#: A recording is useful if it reduces the worst standard error to less than this fraction.
USEFUL_REDUCTION = 0.9

_FRACTIONS = ((1 / 2, "half"), (1 / 3, "a third"), (1 / 4, "a quarter"), (1 / 5, "a fifth"), (1 / 10, "a tenth"))


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain by a manoeuvre: information in nats, and standard errors in SI after it.

    `shrinks_to` is the worst standard error after it, relative to the present one; `reach` in m.
    """

    manoeuvre: str
    nats: float
    shrinks_to: float
    errors: Mapping[str, float]
    reach: float


@dataclass(frozen=True, slots=True)
class Proposal:
    """The recommended manoeuvre, the reason in words, and the gains of all, the best first.

    `errors` are the present standard errors in SI; `worst` names the largest relative to the natural size of its
    parameter. `warnings` name manoeuvres that could not be simulated.
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
    information: Information | None = None,
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
    information : Information, optional
        Present information; parameters other than `names` are marginalised. A factor for white residuals is to be
        multiplied by the square root of effective over actual number of samples, see
        `clutchid.estimation.assess.diagnostics`.
    seconds : s
        Length of each manoeuvre.
    measure : 'position', 'pressure_a'
        Measured columns.
    scales : {name: m or Pa}, optional
        Noise scales of the residuals, by default those of the first stage of a fit.
    memory : s
        Correlation time of the residuals; 0 for white ones.

    Returns
    -------
    proposal : Proposal

    Raises
    ------
    ParameterError
        For an unknown name, none at all, an `R` of the wrong shape, or an impossible length.
    SolveError
        If no manoeuvre can be simulated.

    Notes
    -----
    I is a weak prior of one natural size of each parameter, which limits the weight of directions that no
    manoeuvre determines. Residuals are modelled as a first-order autoregression that restarts at each reset, and
    sensitivities are whitened with it.

    Examples
    --------
    >>> proposal = best_manoeuvre(Actuator(), ("theta_1", "theta_3"), seconds=5.0)
    >>> proposal.gains[0].nats >= proposal.gains[-1].nats > 0.0
    True
    """
    from clutchid.truck import MANOEUVRES, Truck, drive

    _check(actuator, names, information, measure, memory)
    sizes = natural_sizes(actuator, names)
    noise = {name: float(scales[name]) if scales else MEASURED[name].first_scale for name in measure}
    prior = Information(tuple(names), np.eye(len(names)))
    present = prior if information is None else prior.plus(information.marginal(names).R)
    now = present.standard_errors()
    worst = int(np.argmax(now))
    gains, warnings = [], []
    for manoeuvre in MANOEUVRES:
        log = drive(Truck(), manoeuvre=manoeuvre, seconds=seconds, name=manoeuvre).log
        done = simulate(
            actuator, log, partition=Partition(every=RESET_SAMPLES), sensitivities=tuple(names), on_failure="return"
        )
        if done.status == "failed":
            warnings.append(f"'{manoeuvre}' is left out: {done.message}")
            continue
        after = present.plus(np.vstack(list(_whitened(done, actuator, sizes, noise, memory))))
        then, reach = after.standard_errors(), float(np.nanmax(log["position"]))
        errors = dict(zip(names, (then * sizes).tolist(), strict=True))
        gains.append(Gain(manoeuvre, after.nats() - present.nats(), float(then[worst] / now[worst]), errors, reach))
    if not gains:
        raise SolveError("no manoeuvre can be simulated with this actuator. " + " ".join(warnings))
    gains.sort(key=lambda gain: -gain.nats)
    message = _message(gains, names[worst], seconds, information is not None)
    return Proposal(
        gains[0].manoeuvre, seconds, message, names[worst], dict(zip(names, (now * sizes).tolist(), strict=True)),
        tuple(gains), tuple(warnings),
    )  # fmt: skip


def _check(
    actuator: Actuator, names: Sequence[str], information: Information | None, measure: Sequence[str], memory: float
) -> None:
    problems = [unknown_name(name, actuator.names) for name in names if name not in actuator.names]
    problems += [unknown_name(name, MEASURED, "measured column") for name in measure if name not in MEASURED]
    if not names or not measure:
        problems.append("names and measure: at least one free parameter and one measured column are needed.")
    if information is not None and not set(names) <= set(information.names):
        problems.append(f"the information is about {listed(information.names)}: all of {listed(names)} are needed.")
    if not memory >= 0.0:
        problems.append(f"memory = {memory:g} s: at least 0 is needed.")
    if problems:
        raise ParameterError("\n".join(problems))


def _whitened(
    done: Simulation, actuator: Actuator, sizes: FloatArray, noise: Mapping[str, float], memory: float
) -> Iterator[FloatArray]:
    """Triangular factor of the whitened sensitivities for each measured column, in natural sizes."""
    log: Log = done.log
    stride = sample_interval(log.time)
    rho = np.exp(-stride / memory) if memory > 0.0 else 0.0
    begins = np.zeros(len(log), dtype=bool)
    begins[[0, *Partition(every=RESET_SAMPLES).resets(len(log))]] = True
    for name, scale in noise.items():
        state = actuator.states.index(MEASURED[name].state)
        J = np.column_stack([s[:, state] for s in done.sensitivities.values()]) * sizes / scale
        white = np.empty_like(J)
        white[1:] = (J[1:] - rho * J[:-1]) / np.sqrt(1 - rho**2)
        white[begins] = J[begins]
        yield triangular(white[np.all(np.isfinite(white), axis=1)])


def _message(gains: Sequence[Gain], worst: str, seconds: float, known: bool) -> str:
    best = gains[0]
    drive = f"drive '{best.manoeuvre}' for {seconds:g} s"
    if not known:
        over = f", {best.nats - gains[-1].nats:.1f} nats more than '{gains[-1].manoeuvre}'" if len(gains) > 1 else ""
        return f"{drive}: the most informative of {len(gains)} manoeuvres{over}."
    if best.shrinks_to > USEFUL_REDUCTION:
        return (
            f"no manoeuvre of {seconds:g} s determines {worst}: with the best, '{best.manoeuvre}', its standard error "
            f"is still {100 * best.shrinks_to:.0f} % of the present one."
        )
    return f"{drive}: the standard error of {worst} shrinks to {_fraction(best.shrinks_to)}."


def _fraction(part: float) -> str:
    """A fraction in words if a simple one is within a tenth of it, else in %."""
    near = [word for value, word in _FRACTIONS if abs(part / value - 1) <= 0.1]
    return near[0] if near else f"{100 * part:.0f} %" if part >= 0.01 else "less than 1 %"
