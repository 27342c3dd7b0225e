"""What every filter of part (e) follows, and one step of an extended Kalman filter in CasADi, Archimedes and JAX."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from peer import FloatArray
from plain import WEIGHTS, Model, Operations, runge_kutta
from problem import Problem

from clutchid import Actuator, Log
from clutchid.inference.filter.setup import intervals
from clutchid.observer import Observer, observer
from clutchid.observer.state import Tail, segment_of
from clutchid.simulation.noise import start_deviations
from clutchid.simulation.run import start_state
from estimation import noisy, posed

#: Time between samples in s.
SPACING = 1e-3

#: Samples of a stroke of the recording, in which the load weights gain their drift.
STROKE = 2000


class Prior(NamedTuple):
    """What a filter of states and load weights knows before the first sample, and its noise, all in SI.

    State (8,) and covariance (8, 8); variances that it gains in the step to each sample (samples, 8); variance of a
    measured position.
    """

    x: FloatArray
    P: FloatArray
    Q: FloatArray
    R: float


@dataclass(frozen=True)
class Followed:
    """The recording of part (c), of `seconds`, which a filter of 5 states and 3 load weights follows.

    It starts with the load of the paper, which is not that of the recording.
    """

    seconds: float

    @cached_property
    def truth(self) -> Problem:
        """The simulation that the recording is made from."""
        return posed(self.seconds)

    @cached_property
    def log(self) -> Log:
        """The recording."""
        return noisy(self.truth, 0)

    @cached_property
    def duties(self) -> FloatArray:
        """Duty cycles from each sample on, shape (samples, 2)."""
        return np.column_stack([self.log["duty_supply"], self.log["duty_exhaust"]])

    @cached_property
    def shipped(self) -> Observer:
        """clutchid's observer of the paper's weights: it corrects at every tenth sample."""
        return observer(Actuator(), "paper")

    @cached_property
    def every_sample(self) -> Observer:
        """That observer with the work of the peers: it corrects at every sample, and learns while the piston rests."""
        joint = self.shipped.joint
        return replace(self.shipped, joint=replace(joint, settings=replace(joint.settings, every=1, least_speed=0.0)))

    @cached_property
    def prior(self) -> Prior:
        """That of `every_sample`."""
        observer, n = self.every_sample, len(self.log)
        joint, actuator = observer.joint, observer.joint.mapped.actuator
        segment = segment_of(
            Tail(self.log.time, self.duties, self.log["position"], np.full(n, np.nan), np.zeros(n)), actuator
        )
        root = observer.prior.weights @ observer.prior.root
        drifts = observer.prior.weights @ joint.drifts
        P = np.diag(np.append(start_deviations(segment, actuator, False, joint.noise) ** 2, np.zeros(3)))
        P[5:, 5:] = root @ root.T
        Q = np.zeros((n, 8))
        Q[1:, :5] = intervals(segment, actuator, joint.noise, joint.measure).sigma ** 2
        Q[1:, 5:] = (drifts**2).sum(axis=1) / STROKE
        x = np.append(start_state(segment, actuator), actuator.load.theta)
        return Prior(x, P, Q, joint.noise.of_samples("position", SPACING) ** 2)

    @property
    def model(self) -> Model:
        """The model with free load weights."""
        return replace(self.truth, names=WEIGHTS).model

    def error(self, pressure: FloatArray, weights: FloatArray) -> str:
        """Errors of the pressure by sample, after those of the warm-up, and of the load at the end."""
        off = (pressure - self.truth.reference[:, 2])[WARM:]
        return f"{np.sqrt((off**2).mean()):.3g} Pa, load {self.load_error(weights):.2g} %"

    def load_error(self, weights: FloatArray) -> float:
        """Rms error of a load over the stroke in % of its peak."""
        load = self.truth.actuator.load
        position = np.linspace(0.0, self.truth.actuator.parameters.y_max, 200)
        off = replace(load, theta=tuple(map(float, weights))).force(position) - load.force(position)
        return float(100 * np.sqrt((off**2).mean()) / np.abs(load.force(position)).max())


#: First samples of a recording whose times and errors do not count.
WARM = 1000


def casadi_step(followed: Followed) -> Any:
    """A step as a function of CasADi: x, P, duty cycles before, position, Q to x, P; with common expressions shared."""
    import casadi as ca

    law = followed.model.rates(Operations(ca.sqrt, ca.fmax, ca.if_else))
    x, u, z, q = ca.SX.sym("x", 8), ca.SX.sym("u", 2), ca.SX.sym("z"), ca.SX.sym("q", 8)
    P = ca.SX.sym("P", 8, 8)
    parts = ca.vertsplit(x)
    rates = ca.Function("f", [x, u], [ca.vertcat(*law(parts[:5], ca.vertsplit(u), parts[5:]), ca.SX.zeros(3))])
    after = runge_kutta(lambda at: rates(at, u), x, SPACING)
    F = ca.jacobian(after, x)
    grown = F @ P @ F.T + ca.diag(q)
    gain = grown[:, 0] / (grown[0, 0] + followed.prior.R)
    new = [after + gain * (z - after[0]), grown - gain @ grown[0, :]]
    return ca.Function("ekf", [x, P, u, z, q], new, {"cse": True})


def archimedes_step(followed: Followed, all_scalar: bool) -> Any:
    """Archimedes' own filter on its own Runge-Kutta steps, compiled; arguments and results as of `casadi_step`.

    Its rates are recorded as scalar expressions (kind SX), which is faster than its default; with `all_scalar` the
    whole step is.
    """
    import archimedes
    from archimedes.observers import ExtendedKalmanFilter

    law = followed.model.rates(Operations(np.sqrt, np.maximum, np.where))
    R = np.array([[followed.prior.R]])

    def rates(_t: Any, x: Any, u: Any, _p: Any) -> Any:
        return np.hstack([*law([x[i] for i in range(5)], [u[0], u[1]], [x[5], x[6], x[7]]), 0.0, 0.0, 0.0])

    moved = archimedes.discretize(archimedes.compile(rates, kind="SX"), dt=SPACING, method="rk4")

    def ekf(x: Any, P: Any, u: Any, z: Any, q: Any) -> Any:
        kalman = ExtendedKalmanFilter(
            dyn=lambda t, x, u: moved(t, x, u, 0.0), obs=lambda _t, x, _u: x[0], Q=np.diag(q), R=R
        )
        return kalman.step(0.0, x, z, P, (u,))[:2]

    return archimedes.compile(ekf, return_names=("x_new", "P_new"), kind="SX" if all_scalar else "MX")


def jax_step(followed: Followed) -> Callable[..., Any]:
    """A step compiled by JAX, with forward derivatives."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    law, R = followed.model.rates(Operations(jnp.sqrt, jnp.maximum, jnp.where)), followed.prior.R

    def moved(x: Any, u: Any) -> Any:
        return runge_kutta(lambda at: jnp.stack([*law(at[:5], u, at[5:]), 0.0, 0.0, 0.0]), x, SPACING)

    def ekf(x: Any, P: Any, u: Any, z: Any, q: Any) -> Any:
        after, F = moved(x, u), jax.jacfwd(moved)(x, u)
        grown = F @ P @ F.T + jnp.diag(q)
        gain = grown[:, 0] / (grown[0, 0] + R)
        return after + gain * (z - after[0]), grown - jnp.outer(gain, grown[0])

    return jax.jit(ekf)
