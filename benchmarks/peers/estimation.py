"""Part (c): three load weights from a recording by the paper's method, from many starts and over noise seeds."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import octave
from equations import python_text
from peer import FloatArray, Peer, Row
from plain import STATES, UNIT, WEIGHTS, casadi_search, jax_rates, scipy_position, searched
from problem import NOISE, THETA, Problem, recording
from recorded import casadi_library, jax_states

from clutchid import Actuator, Load, Log, fit

#: A search has succeeded if no weight is further from the truth than so many standard deviations of the bound.
NEAR = 5.0

#: Rest in s before the first stroke, from which clutchid takes the position at the start.
REST = 0.3

Estimate = Callable[[Log, FloatArray], FloatArray]


class Run(NamedTuple):
    """A finished search: seconds, and weights in N/m."""

    seconds: float
    theta: FloatArray


def clutchid(problem: Problem) -> Estimate:
    """`clutchid.fit` as a user calls it, with inspection, covariance, verdict."""
    del problem
    names = Load().names

    def estimate(log: Log, start: FloatArray) -> FloatArray:
        estimates = fit(log, Actuator(load=Load(tuple(start))), free="load").parameters
        return np.array([estimates[name].value for name in names])

    return estimate


def posed_search(
    position: Callable[[FloatArray], FloatArray], jacobian: Callable[[FloatArray], FloatArray] | None = None
) -> Estimate:
    """`plain.searched` on the position of a log."""
    estimate = searched(NOISE, position, jacobian)
    return lambda log, start: estimate(log["position"], start)


def casadi_peer(problem: Problem) -> Estimate:
    """`least_squares` on CasADi's compiled Runge-Kutta; residuals take a function without derivatives."""
    estimate = casadi_search(NOISE, casadi_library(problem), casadi_library(problem, columns=False))
    return lambda log, start: estimate(log["position"], start)


def jax_peer(problem: Problem) -> Estimate:
    """`least_squares` on the loop of JAX."""
    import jax

    states = jax_states(problem)
    position = jax.jit(lambda q: states(q)[:, 0])
    jacobian = jax.jit(jax.jacfwd(position))
    return posed_search(lambda q: np.asarray(position(q)), lambda q: np.asarray(jacobian(q)))


def scipy_search(problem: Problem, method: str) -> Estimate:
    """`least_squares` with finite differences on `solve_ivp`."""

    return posed_search(scipy_position(python_text(problem.values), problem.given, method))


def aeroid_peer(problem: Problem) -> Estimate:
    """`aeroid.identify` with the exact Jacobian of its loop of JAX, which it compiles anew for every recording.

    Its inputs are straight lines between samples: a sample 1 µs before every edge holds the one before. Its parameters
    are divided by their start, and a weight may start at 0: 1 stands for that.
    """
    import aeroid
    import jax.numpy as jnp

    rates, edges, d = jax_rates(problem.model), np.array(problem.edges[1:-1]), problem.drive
    shift = dict(zip(WEIGHTS, (0.0, 1.0, 1.0), strict=True))

    def dynamics(_: float, x: FloatArray, u: FloatArray, p: Mapping[str, float]) -> FloatArray:
        derivatives: FloatArray = rates(x, u, jnp.stack([(p[name] - shift[name]) * UNIT for name in WEIGHTS]))
        return derivatives

    def estimate(log: Log, start: FloatArray) -> FloatArray:
        guess = {name: value / UNIT + shift[name] for name, value in zip(WEIGHTS, start, strict=True)}
        model = aeroid.Model(STATES, ("supply", "exhaust"), guess, dynamics)
        held = {"supply": d.u[:, 0], "exhaust": d.u[:, 1], "y": log["position"]}
        channels = {name: np.insert(a, edges, a[edges - (name != "y")]) for name, a in held.items()}
        data = aeroid.FlightData(np.insert(problem.time, edges, problem.time[edges] - 1e-6), channels)
        identified = aeroid.identify(
            model, data, WEIGHTS, gradient="jax", outputs=["y"], weights={"y": 1 / NOISE}, x0=d.x0,
            bounds={name: (shift[name], np.inf) for name in ("theta_1", "theta_3")},
        )  # fmt: skip
        return np.array([(identified.parameters[name] - shift[name]) * UNIT for name in WEIGHTS])

    return estimate


def octave_search(problem: Problem) -> Estimate:
    """`lsqnonlin` of GNU Octave on its `ode45`; the half second in which its process starts counts."""
    folder = Path(tempfile.mkdtemp())

    def estimate(log: Log, start: FloatArray) -> FloatArray:
        octave.write_search(problem, folder, log["position"], start)
        return np.array(octave.printed(folder, "search.m").split(), float)

    return estimate


#: `longest` is the number of starts here.
PEERS = (
    Peer("clutchid.fit", (), clutchid),
    Peer("CasADi compiled, least_squares", ("casadi", "gcc"), casadi_peer),
    Peer("JAX, least_squares", ("jax",), jax_peer),
    Peer("SciPy LSODA, least_squares", ("scipy",), partial(scipy_search, method="LSODA"), 1),
    Peer("SciPy RK45, least_squares", ("scipy",), partial(scipy_search, method="RK45"), 1),
    Peer("AeroID, output error, gradient of JAX", ("aeroid", "jax"), aeroid_peer),
    Peer("Octave ode45, lsqnonlin", ("octave-optim",), octave_search, 1),
)


def bound(problem: Problem) -> FloatArray:
    """Standard deviations of the Cramér-Rao bound of the weights for white noise, N/m."""
    J = problem.reference_jacobian / NOISE
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


def noisy(problem: Problem, seed: int) -> Log:
    """A recording of the reference, so that no peer fits data of its own steps, with noise drawn from `seed`."""
    d = problem.drive
    noise = np.random.default_rng(seed).normal(0, NOISE, problem.time.size)
    columns = {"duty_supply": d.u[:, 0], "duty_exhaust": d.u[:, 1], "position": problem.reference[:, 0] + noise}
    return Log(problem.time, columns)


def drawn_starts(count: int) -> FloatArray:
    """Weights to start from, N/m, shape (count, 3): the paper's first, then far around it."""
    random = np.random.default_rng(7)
    low, high = np.array([4e5, -1e5, 0.0]), np.array([16e5, 1e5, 3e5])
    return np.vstack([[9e5, 0.0, 0.0], random.uniform(low, high, (count - 1, 3))])


def posed(seconds: float, rest: float = REST) -> Problem:
    """The recording's simulation at the true weights, after `rest` s at rest."""
    log = recording(seconds)
    inputs = np.column_stack([log["duty_supply"], log["duty_exhaust"]])
    inputs = np.vstack([np.zeros((round(rest * 1000), 2)), inputs])
    return Problem(seconds + rest, names=WEIGHTS, actuator=Actuator(load=Load(THETA)), inputs=inputs)


def rows(seconds: float = 4.0, starts: int = 20, peers: Sequence[Peer] = PEERS) -> list[Row]:
    """A search from every start, each on a recording with noise of its own, peers in turn."""
    problem, case = posed(seconds), f"{seconds:g} s at 1000 Hz, {starts} starts"
    deviations = bound(problem)
    estimates, ready = {}, []
    points = drawn_starts(starts)
    for peer in peers:
        if lacking := peer.missing():
            estimates[peer.name] = Row("c", case, peer.name, note=f"absent: {', '.join(lacking)} not installed")
            continue
        begin = time.perf_counter()
        estimate = peer.prepare(problem)
        if peer.longest > 1:
            estimate(noisy(problem, 0), points[0])
        ready.append((peer, estimate, time.perf_counter() - begin))
    runs: dict[str, list[Run]] = {peer.name: [] for peer, _, _ in ready}
    for seed, start in enumerate(points):
        log = noisy(problem, seed)
        for peer, estimate, _ in ready:
            if seed < peer.longest:
                begin = time.perf_counter()
                theta = estimate(log, start)
                runs[peer.name].append(Run(time.perf_counter() - begin, theta))
    first = [run.seconds for run in runs[ready[0][0].name]]
    for peer, _, prepared in ready:
        times = [run.seconds for run in runs[peer.name]]
        off = np.array([np.abs(run.theta - THETA) / deviations for run in runs[peer.name]]).max(axis=1)
        low, middle, high = np.quantile(times, [0.25, 0.5, 0.75])
        words = f"{np.sum(off < NEAR)} of {off.size} succeeded, worst weight off by {np.median(off):.2g} σ (median)"
        ratio = float(np.median([a / b for a, b in zip(times, first, strict=False)]))
        note = "" if len(times) == starts else f"{len(times)} of {starts} starts"
        estimates[peer.name] = Row("c", case, peer.name, middle, low, high, len(times), ratio, prepared, words, note)
    return [estimates[peer.name] for peer in peers]


def coverage(seeds: int, seconds: float = 4.0, rest: float = REST) -> str:
    """How often clutchid's 95 % intervals hold the true weights, and its spread against the bound.

    Without a `rest` in s clutchid starts the piston at the first sample, with its noise.
    """
    problem = posed(seconds, rest)
    deviations, hits, thetas = bound(problem), np.zeros(3), []
    for seed in range(1000, 1000 + seeds):
        log = noisy(problem, seed)
        parameters = fit(log, free="load").parameters
        estimates = [parameters[name] for name in WEIGHTS]
        hits += [e.low <= true <= e.high for e, true in zip(estimates, THETA, strict=True)]
        thetas.append([e.value for e in estimates])
    spread = np.std(thetas, axis=0, ddof=1) / deviations
    bias = (np.mean(thetas, axis=0) - THETA) / deviations
    shares = ", ".join(f"{share:.1%}" for share in hits / seeds)
    start = f", after {rest:g} s at rest," if rest else ", with the supply valve opened at the first sample,"
    return (
        f"Over {seeds} noise seeds{start} the 95 % intervals of theta_1, theta_2, theta_3 hold the truth in {shares} "
        f"(target 93 to 97 %); standard deviations are {', '.join(f'{s:.2f}' for s in spread)} of the "
        f"Cramér-Rao bound, the mean is off by {', '.join(f'{b:.2f}' for b in bias)} of it."
    )
