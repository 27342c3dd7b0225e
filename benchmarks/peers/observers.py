"""Part (e): one step of an observer by clutchid, and of an extended Kalman filter in other packages."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from ekf import SPACING, WARM, Followed, archimedes_step, casadi_step, jax_step
from ekf_in_c import Steps, archimedes_in_c, casadi_in_c, exported
from equations import python_text
from peer import FloatArray, Peer, Row
from plain import UNIT, USUAL, runge_kutta, scalar_rates

from clutchid import Log
from clutchid.observer import observe, observe_recording, start

#: A step to a sample of a number, and what is known after it: pressure, load weights.
Stepping = tuple[Callable[[int], None], Callable[[], tuple[float, FloatArray]]]

#: Samples of a longer block.
BLOCK = 100

#: Differences for derivatives of a filter that has none, by state and weight: larger ones reach over kinks of the flow
#: and of the friction.
DIFFERENCES = 1e-7 * np.append(USUAL, np.full(3, UNIT))


def stepped(followed: Followed, begin: Callable[[], Stepping]) -> Callable[[], Steps]:
    """A pass over the recording in which each step is timed alone."""
    n, clock = len(followed.log), time.perf_counter_ns

    def run() -> Steps:
        advance, state = begin()
        took, pressure = np.zeros(n), np.zeros(n)
        pressure[0], weights = state()
        for i in range(1, n):
            begin_ns = clock()
            advance(i)
            took[i] = clock() - begin_ns
            pressure[i], weights = state()
        idle = np.diff([clock() for _ in range(10_000)])
        return Steps(took * 1e-9, pressure, weights, float(np.median(idle)) * 1e-9)

    return run


def from_python(followed: Followed, step: Callable[..., Any], read: Callable[[Any], FloatArray]) -> Callable[[], Steps]:
    """A pass of a step that takes and returns x and P; `read` makes x an array."""
    prior, position = followed.prior, [np.array([value]) for value in followed.log["position"]]
    duties, Q = list(followed.duties), list(prior.Q)

    def begin() -> Stepping:
        at = [prior.x, prior.P]

        def advance(i: int) -> None:
            at[:] = step(*at, duties[i - 1], position[i], Q[i])

        def known() -> tuple[float, FloatArray]:
            x = read(at[0])
            return float(x[2]), x[5:]

        return advance, known

    return stepped(followed, begin)


def single_samples(followed: Followed) -> Callable[[], Steps]:
    """`clutchid.observer.observe` on blocks of one sample, with the making of the block."""
    joint, log, n = followed.every_sample, followed.log, len(followed.log)
    columns = {name: [values[i : i + 1] for i in range(n)] for name, values in log.columns.items()}
    instants = [log.time[i : i + 1] for i in range(n)]

    def begin() -> Stepping:
        state, run = observe(joint, start(joint), log.slice(0, 1))
        at: list[Any] = [state, run]

        def advance(i: int) -> None:
            block = Log(instants[i], {name: values[i] for name, values in columns.items()})
            at[:] = observe(joint, at[0], block)

        def known() -> tuple[float, FloatArray]:
            return float(at[1].states[-1, 2]), np.array(joint.load(at[0]).theta)

        return advance, known

    return stepped(followed, begin)


def blocks(followed: Followed) -> Callable[[], Steps]:
    """`clutchid.observer.observe` on blocks of `BLOCK` samples; a time is that of a block over its samples."""
    joint, log, n = followed.every_sample, followed.log, len(followed.log)

    def run() -> Steps:
        state, took, pressure = start(joint), np.zeros(n), np.zeros(n)
        for a, b in pairwise([*range(0, n, BLOCK), n]):
            block = log.slice(a, b)
            begin = time.perf_counter_ns()
            state, observed = observe(joint, state, block)
            took[a:b] = (time.perf_counter_ns() - begin) * 1e-9 / (b - a)
            pressure[a:b] = observed.states[:, 2]
        return Steps(took, pressure, np.array(joint.load(state).theta), 0.0)

    return run


def whole(followed: Followed) -> Callable[[], Steps]:
    """`clutchid.observer.observe_recording`; a time is that of the recording over its samples."""
    joint, log = followed.every_sample, followed.log

    def run() -> Steps:
        begin = time.perf_counter_ns()
        observed = observe_recording(joint, log)
        took = (time.perf_counter_ns() - begin) * 1e-9 / len(log)
        weights = np.array(joint.load(observed.after).theta)
        return Steps(np.full(len(log), took), observed.samples.states[:, 2], weights, 0.0)

    return run


def filterpy(followed: Followed) -> Callable[[], Steps]:
    """filterpy's filter on a scalar right-hand side, as a user writes it, with derivatives by differences."""
    from filterpy.kalman import ExtendedKalmanFilter

    prior, problem = followed.prior, followed.truth
    rates, breakpoints, basis = scalar_rates(python_text(problem.values)), *problem.model[-2:]
    segments, row = breakpoints.tolist(), np.eye(1, 8)

    def moved(x: FloatArray, u: FloatArray) -> FloatArray:
        table, (u_vs, u_ve) = (segments, np.tensordot(x[5:], basis, 1).tolist()), u.tolist()
        after = runge_kutta(lambda at: np.array(rates(*at.tolist(), u_vs, u_ve, table)), x[:5], SPACING)
        return np.append(after, x[5:])

    class Actuator(ExtendedKalmanFilter):  # type: ignore[misc]
        def predict_x(self, u: FloatArray) -> None:
            self.x = moved(self.x, u)

    duties, position, Q = list(followed.duties), followed.log["position"].tolist(), [np.diag(q) for q in prior.Q]

    def begin() -> Stepping:
        actuator = Actuator(8, 1)
        actuator.x, actuator.P, actuator.R = prior.x.copy(), prior.P.copy(), np.array([[prior.R]])

        def advance(i: int) -> None:
            u, at = duties[i - 1], moved(actuator.x, duties[i - 1])
            columns = [(moved(actuator.x + h, u) - at) / h.sum() for h in np.diag(DIFFERENCES)]
            actuator.F, actuator.Q = np.column_stack(columns), Q[i]
            actuator.predict(u)
            actuator.update(position[i], lambda _: row, lambda x: x[:1])

        return advance, lambda: (float(actuator.x[2]), actuator.x[5:])

    return stepped(followed, begin)


def casadi_peer(followed: Followed) -> Callable[[], Steps]:
    """The function of CasADi, called from Python."""
    return from_python(followed, casadi_step(followed), lambda x: np.asarray(x).ravel())


def archimedes_peer(followed: Followed) -> Callable[[], Steps]:
    """The function of Archimedes, called from Python."""
    return from_python(followed, archimedes_step(followed, False), np.asarray)


def jax_peer(followed: Followed) -> Callable[[], Steps]:
    """The function of JAX, called from Python, until its result is there."""
    import jax

    step = jax_step(followed)
    return from_python(followed, lambda *arguments: jax.block_until_ready(step(*arguments)), np.asarray)


IN_PYTHON = (
    Peer("clutchid.observe, a sample at a time", (), single_samples),
    Peer(f"clutchid.observe, blocks of {BLOCK}", (), blocks),
    Peer("clutchid.observe_recording", (), whole),
    Peer("filterpy, ExtendedKalmanFilter", ("filterpy",), filterpy),
    Peer("Archimedes, ExtendedKalmanFilter, compiled", ("archimedes",), archimedes_peer),
    Peer("CasADi, a function", ("casadi",), casadi_peer),
    Peer("JAX, compiled", ("jax",), jax_peer),
)

#: The row that the targets are held against.
ARCHIMEDES = "Archimedes, generated C"

IN_C = (
    Peer("clutchid, exported C", ("gcc",), partial(exported, every_sample=True, real="double")),
    Peer("clutchid, exported C as shipped, double", ("gcc",), partial(exported, every_sample=False, real="double")),
    Peer("clutchid, exported C as shipped, float", ("gcc",), partial(exported, every_sample=False, real="float")),
    Peer(ARCHIMEDES, ("archimedes", "gcc"), partial(archimedes_in_c, all_scalar=False)),
    Peer(f"{ARCHIMEDES}, all of kind SX", ("archimedes", "gcc"), partial(archimedes_in_c, all_scalar=True)),
    Peer("CasADi, generated C", ("casadi", "gcc"), casadi_in_c),
)

#: Notes of rows whose times are not those of single steps.
SHARED = {IN_PYTHON[1].name: "of a block, by sample", IN_PYTHON[2].name: "of the recording, by sample"}


def compared(case: str, followed: Followed, peers: Sequence[Peer], rounds: int, budget: float) -> list[Row]:
    """Rows of peers that follow a recording in turn; a peer that has used `budget` s takes part in no further round."""
    rows, ready = {}, []
    for peer in peers:
        if lacking := peer.missing():
            rows[peer.name] = Row("e", case, peer.name, note=f"absent: {', '.join(lacking)} not installed")
            continue
        begin = time.perf_counter()
        try:
            run = peer.prepare(followed)
            prepared = time.perf_counter() - begin
            states = run()
        except Exception as failure:  # a peer that fails is a row, not the end of the others
            rows[peer.name] = Row("e", case, peer.name, note=f"failed: {type(failure).__name__}: {failure}"[:200])
            continue
        error = followed.error(states.pressure, states.weights)
        rows[peer.name] = Row("e", case, peer.name, prepared=prepared, error=error)
        ready.append((peer.name, run))
    times: dict[str, list[FloatArray]] = {name: [] for name, _ in ready}
    clocks = []
    for _ in range(rounds):
        for name, run in ready:
            if sum(seconds.sum() for seconds in times[name]) < budget:
                states = run()
                times[name].append(states.seconds[WARM:])
                clocks.append(states.clock)
    first = [np.median(seconds) for seconds in times[ready[0][0]]]
    for name, seconds in times.items():
        low, middle, high, *tail = np.quantile(np.concatenate(seconds), [0.25, 0.5, 0.75, 0.99, 0.999])
        ratio = float(np.median([np.median(a) / b for a, b in zip(seconds, first, strict=False)]))
        steps, note = sum(map(len, seconds)), SHARED.get(name, "")
        tail = [np.nan, np.nan] if note else tail
        rows[name] = rows[name]._replace(
            median=middle, low=low, high=high, runs=steps, ratio=ratio, more=tuple(map(float, tail)), note=note
        )
    read = [clock for clock in clocks if clock] or [0.0]
    clock = f"reading the clock takes {np.median(read) * 1e9:.0f} ns of each time"
    rows[ready[0][0]] = rows[ready[0][0]]._replace(note=clock)
    return [rows[peer.name] for peer in peers]


def rows(
    seconds: float = 20.0,
    in_python: Sequence[Peer] = IN_PYTHON,
    in_c: Sequence[Peer] = IN_C,
    rounds: int = 15,
    budget: float = 8.0,
) -> list[Row]:
    """The rows of steps called from Python, and of those in C."""
    followed = Followed(seconds)
    before = followed.load_error(np.array(followed.shipped.actuator.load.theta))
    case = f"{seconds:g} s at 1000 Hz, load {before:.2g} % off at the start"
    return [
        *compared(f"Called from Python, {case}", followed, in_python, rounds, budget),
        *compared(f"In C, {case}", followed, in_c, rounds, budget),
    ]
