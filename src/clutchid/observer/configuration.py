"""An observer: a calibrated actuator, what of it adapts, and the filter that does it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.filter.joint_filter import JointFilter, JointSettings, init, joint_filter
from clutchid.inference.filter.setup import FilterState
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray
from clutchid.log.states import SENSORS
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load
from clutchid.observer.inputs import no_inputs
from clutchid.observer.methods import EVERY, method_for
from clutchid.observer.prior import (
    AIR_STD,
    ASSUMED,
    BOUND,
    BY_FORMULA,
    KNOWN_AIR_STD,
    LEAK,
    SUPPLY_STD,
    Air,
    OnlinePrior,
    RecordedSupply,
    air_of,
    considered_supply,
    deviation_by_air,
    load_deviation,
    online_prior,
    supply_of,
)
from clutchid.observer.state import EMPTY, ObserverState, Sound, Tail, segment_of
from clutchid.simulation.noise import Noise
from clutchid.simulation.stiffness import pace
from clutchid.strokes.travel import suspect_from
from clutchid.strokes.vented_rest import Zero

#: Correlation time of what the model misses in s, and covariance that load weights and parameters gain in a stroke, as
#: a share of that of their prior. Provenance: docs/derivations_online.md.
_MEMORY, DRIFT = 0.01, 2e-4

#: Standard deviations in SI of states at the start of a stretch that is not vented, in place of those of their rows: a
#: hole ends in any motion. The pressure is that of load and friction at the speed but for 20 kPa; bristles do not bend
#: further than sliding bends them. Provenance: docs/derivations_online.md.
_UNKNOWN_START = MappingProxyType({"v": 0.3, "z": 5e-5, "p_A": 2e4})

#: Factor on the stiffness of the calibrated actuator, whose parameters adapt.
_MARGIN = 1.05

#: A leak of so many standard deviations is one. Provenance: docs/derivations_online.md.
LEAK_FOUND = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Observer:
    """An observer of a calibrated actuator, as `observer` makes it.

    Attributes
    ----------
    actuator
        As calibrated.
    method
        'joint', 'states' or 'paper'.
    joint
        The filter, compiled for this actuator.
    prior
        What is known of the parameters that adapt before the first sample.
    adapting
        Names of the load weights and parameters that adapt.
    spacing : s
        Interval between samples.
    missed : N
        Rms error, over the stroke, of a load from position alone on the calibration recordings.
    supply
        How the recorded supply pressure is used; None where it is not.
    air
        How a recorded temperature of the air is used; None where it is not.
    calibration
        The calibration; None without one.
    zero
        'subtract' or 'keep': whether a vented rest that has moved is subtracted from the position.
    supply_std
        Standard deviation of a supply pressure that is not recorded, as a share of that of the calibration.

    Examples
    --------
    What adapts on line in the paper's model: the load, friction, dead volume, far stop and the lag of the sensor.

    >>> import clutchid
    >>> observer(clutchid.Actuator()).adapting
    ('theta_1', 'theta_2', 'theta_3', 'F_C', 'V_0A', 'y_max', 'D_v', 'tau_y')
    """

    actuator: Actuator
    method: str
    joint: JointFilter
    prior: OnlinePrior
    adapting: tuple[str, ...]
    spacing: float
    missed: float
    supply: RecordedSupply | None = None
    air: Air | None = None
    calibration: Calibration | None = None
    zero: Zero = "subtract"
    supply_std: float = SUPPLY_STD

    @property
    def usual(self) -> float:
        """Mean NIS of the calibration recordings, NaN where unknown."""
        return self.calibration.nis if self.calibration else float("nan")

    @property
    def compares(self) -> bool:
        """Whether innovations are compared with the usual ones."""
        return bool(np.isfinite(self.usual))

    @property
    def suspect_from(self) -> float:
        """Recorded position in m beyond which the travel is suspect, infinite where that as calibrated is not known."""
        return suspect_from(self.calibration.travel if self.calibration else None)

    def leaks(self, state: ObserverState) -> bool:
        """Whether a leak of chamber A that adapts is beyond `LEAK_FOUND` of its standard deviations."""
        at = next((j for j, c in enumerate(self.joint.coordinates) if c.base == LEAK), None)
        if at is None:
            return False
        return bool(state.theta[at] > LEAK_FOUND * np.linalg.norm(state.T[at]))

    def load(self, state: ObserverState) -> Load:
        """The load as it is known in a state, in the basis of the calibration."""
        weights = np.asarray(self.actuator.load.theta) + self.prior.weights @ state.theta
        return replace(self.actuator.load, theta=tuple(weights.tolist()))

    def load_deviation(self, state: ObserverState, position: FloatArray, *, as_calibrated: bool = False) -> FloatArray:
        """Standard deviation in N of that load at positions in m, shape (n,).

        It has parts that no recording makes smaller: what the model missed on the calibration recordings, and the
        supply pressure, whether it is recorded or assumed. Where the innovations are larger than in those recordings,
        its variance is as much larger. Air and grease may have another temperature than in the calibration, or than is
        recorded, see `deviation_by_air`; some time after the last value that counts it is unknown. A supply that is not
        recorded may have changed since, see `considered_supply`: that part is left out if the supply is
        `as_calibrated`.
        """
        load = self.load(state)
        share = self.supply.share if self.supply else ASSUMED
        by_supply = load_deviation(share, self.actuator, load, position)
        deviations = load.phi(position) @ self.prior.weights @ state.T
        squared = np.sum(deviations**2, axis=1) + self.missed**2 + by_supply**2
        by_air = KNOWN_AIR_STD if state.air_known else AIR_STD
        variance = max(1.0, state.mismatch) * squared + deviation_by_air(by_air, self.actuator, load, position) ** 2
        deviation: FloatArray = np.sqrt(variance if as_calibrated else variance + self._considered(state, position))
        return deviation

    def _considered(self, state: ObserverState, position: FloatArray) -> FloatArray:
        """Variance in N² of the load by what is considered at positions in m, shape (n,)."""
        load = self.load(state)
        if self.joint.considered is None:
            return load_deviation(BY_FORMULA * self.supply_std, self.actuator, load, position) ** 2
        by_supply: FloatArray = load.phi(position) @ self.prior.weights @ state.G
        return np.asarray(np.sum(by_supply**2, axis=1))


def observer(
    actuator: Actuator,
    method: str = "joint",
    spacing: float = 1e-3,
    calibration: Calibration | None = None,
    zero: Zero = "subtract",
    supply_std: float = SUPPLY_STD,
    supply_sensor_std: float | None = None,
) -> Observer:
    """An observer of a calibrated actuator.

    Parameters
    ----------
    actuator : Actuator
        As calibrated; the observer starts from its load.
    method
        One of `clutchid.observer.methods.METHODS`.
    spacing : s
        Time from one sample to the next.
    calibration : Calibration, optional
        Its errors from position alone are part of every band; its vented rest is what travel is counted from.
    zero : 'subtract' or 'keep'
        Whether the position counts from the vented rest where that has moved since the calibration.
    supply_std
        Standard deviation of a supply pressure that is not recorded, as a share of that of the calibration, from 0 to
        0.5.
    supply_sensor_std
        Standard deviation of a recorded supply pressure from that of the calibration by the errors of both sensors, as
        a share of it, from 0 to 0.5; by default that of 0.5 % of 10 bar each.

    Raises
    ------
    ParameterError
        If a standard deviation is another one, there is no such method, or it does not take the actuator.
    """
    adapting = method_for(method, actuator).adapting(actuator)
    defaults = {"supply_std": (supply_std, f"{SUPPLY_STD:g}"), "supply_sensor_std": (supply_sensor_std, "some 0.007")}
    for name, (std, default) in defaults.items():
        if std is not None and not 0.0 <= std <= 0.5:
            raise ParameterError(
                f"{name} = {std:g}: the standard deviation of the supply pressure is a share of it from 0 to 0.5; "
                f"{default} is the default."
            )
    supply = supply_of(actuator, calibration, supply_sensor_std)
    measure = ("position",) if supply is None else ("position", "pressure_supply")
    prior = online_prior(actuator, adapting)
    settings = JointSettings(every=max(1, round(EVERY * 1e-3 / spacing)), spacing=spacing)
    noise = Noise(
        measured={name: SENSORS[name].noise for name in measure},
        states={name: row.noise for name, row in actuator.state_rows.items()},
        memory=_MEMORY,
        unknown_start=dict(_UNKNOWN_START),
    )
    limits = np.array([0.0 if c.base == LEAK else -BOUND for c in prior.free]), np.full(len(prior.free), BOUND)
    return Observer(
        actuator=actuator,
        method=method,
        joint=joint_filter(
            actuator,
            prior.free,
            limits,
            measure,
            noise,
            settings,
            drifts=np.sqrt(DRIFT) * prior.root,
            pace=pace(actuator, _MARGIN),
            considered=considered_supply(actuator, supply_std),
        ),
        prior=prior,
        adapting=adapting,
        spacing=spacing,
        missed=_missed(actuator, calibration),
        supply=supply,
        air=air_of(actuator, calibration),
        calibration=calibration,
        zero=zero,
        supply_std=supply_std,
    )


def _missed(actuator: Actuator, calibration: Calibration | None) -> float:
    """Error in N of a load from position alone of the calibration recordings, rms over the stroke."""
    if calibration is None or calibration.position_only is None:
        return 0.0
    position = np.linspace(0.0, actuator.parameters.y_max, 100)
    shift = calibration.position_only.shift((), list(actuator.load.names))
    return float(np.sqrt(np.mean((actuator.load.phi(position) @ shift) ** 2)))


def start(observer: Observer) -> ObserverState:
    """The state before the first sample."""
    theta, T = np.zeros(len(observer.prior.free)), observer.prior.root.copy()
    G = np.zeros((theta.size, 0 if observer.joint.considered is None else observer.joint.considered.start.shape[1]))
    none = np.zeros(1, dtype=np.int64)
    return ObserverState(
        None, theta, T, G, none, EMPTY, unknown(observer), Sound(theta, T, G, none), no_inputs(observer.spacing)
    )


def blank(observer: Observer) -> FilterState:
    """A state of the filter with the shapes that all of its states have."""
    at_rest = Tail(np.zeros(1), np.zeros((1, 2)), *np.zeros((3, 1)))
    segment = segment_of(at_rest, observer.joint.mapped.actuator)
    return init(observer.joint, segment, np.zeros(len(observer.prior.free)), observer.prior.root)


def unknown(observer: Observer) -> FloatArray:
    """Standard deviations of the states before the first correction."""
    return np.full(len(observer.actuator.states), np.nan)
