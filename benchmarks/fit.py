"""A whole fit against SciPy on a scalar Python right-hand side: ``python benchmarks/fit.py``.

The peer is what a script from MATLAB becomes in Python: `solve_ivp` RK45 (rtol 1e-6, max_step one sample) inside
`least_squares` with finite differences. A whole peer fit takes many minutes, so one of its simulations is timed on a
part of the recording and scaled to 10 s; how many simulations its search needs is counted with the same
`least_squares` on clutchid's simulation.

``--calls 15`` times repeated calls, 15 turns of each in processor time: a warm fit of that recording, a simulation of
1.5 s with other parameters each time, and a sample of an observer.
"""

from __future__ import annotations

import argparse
import importlib.util
import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from clutchid import Actuator, Load, Log, fit, simulate
from clutchid.observer import observe, observer, start

THETA = (8.6e5, -0.3e5, 1.0e5)
NOISE = 3e-5


def plain_twin() -> ModuleType:
    """The scalar right-hand side of the tests, typed from the paper."""
    path = Path(__file__).parent.parent / "tests" / "oracles" / "conftest.py"
    spec = importlib.util.spec_from_file_location("plain_twin", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def recording(seconds: float) -> Log:
    """Strokes of different reach made by the paper's model, with white noise on the position."""
    t = np.arange(round(seconds * 1000)) * 1e-3
    phase, number = t % 2.0, np.floor(t / 2.0)
    supply = np.where(phase < 0.06 + 0.02 * number, 0.8, 0.0)
    exhaust = np.where(phase > 0.8, 0.4, 0.0)
    log = Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})
    made = simulate(Actuator(load=Load(THETA)), log).log["position"]
    return log.with_columns(position=made + np.random.default_rng(0).normal(0, NOISE, t.size))


def peer_simulation(twin: ModuleType, log: Log, samples: int) -> np.ndarray:
    """Position at the first `samples` samples by `solve_ivp` RK45 with held inputs."""
    u = np.column_stack([log["duty_supply"], log["duty_exhaust"]])
    t = log.time[:samples]
    dt = float(t[1] - t[0])

    def rates(at: float, x: np.ndarray) -> list[float]:
        return twin.rates(x, u[min(int(at / dt), samples - 1)], THETA, twin.APPENDIX)

    x0 = [log["position"][0], 0.0, 1.095e5, 1.095e5, 0.0]
    return solve_ivp(rates, (t[0], t[-1]), x0, "RK45", t, rtol=1e-6, atol=1e-9, max_step=dt).y[0]


def peer_evaluations(log: Log) -> int:
    """Simulations that `least_squares` with finite differences takes from the paper's start."""
    count = 0

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return (simulate(Actuator(load=Load(tuple(x * 1e5))), log).log["position"] - log["position"]) / NOISE

    bounds = ([0, -np.inf, 0], np.inf)
    least_squares(residuals, [9.0, 0.0, 0.0], bounds=bounds, x_scale=[1, 0.1, 0.1], diff_step=1e-5)
    return count


def seconds_of(calls: Sequence[Callable[[], object]]) -> float:
    """Processor time of a call, mean of several."""
    begin = time.process_time()
    for call in calls:
        call()
    return (time.process_time() - begin) / len(calls)


def observed(samples: Sequence[Log]) -> None:
    """Follow blocks of one sample."""
    joint = observer(Actuator())
    state = start(joint)
    for sample in samples:
        state, _ = observe(joint, state, sample)


def print_calls(log: Log, rounds: int) -> None:
    """Print median, least and largest processor time of each call."""
    t = np.arange(1500) * 1e-3
    supply, exhaust = np.where((t > 0.3) & (t < 0.5), 1.0, 0.0), np.where((t > 0.9) & (t < 1.2), 1.0, 0.0)
    inputs = Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})
    factors, samples = np.random.default_rng(0), [log.slice(i, i + 1) for i in range(2000)]
    position = simulate(Actuator(), inputs).log["position"] + factors.normal(0, NOISE, t.size)
    measured = inputs.with_columns(position=position)

    def others() -> list[Actuator]:
        usual = {"D_v": 5000.0, "C_vs": 19e-9, "F_C": 200.0}
        draws = 1 + 0.1 * factors.standard_normal((300, 3))
        return [Actuator().replace(dict(zip(usual, draw * [*usual.values()], strict=True))) for draw in draws]

    rows: dict[str, list[float]] = {}
    for _ in range(rounds + 1):
        took = {
            "fit of three weights, 10 s": seconds_of([partial(fit, log)] * 10),
            "simulate 1.5 s": seconds_of([partial(simulate, actuator, inputs) for actuator in others()]),
            "with a position": seconds_of([partial(simulate, actuator, measured) for actuator in others()]),
            "observe one sample": seconds_of([partial(observed, samples)]) / len(samples),
        }
        for name, seconds in took.items():
            rows.setdefault(name, []).append(seconds * 1e6)
    for name, (_, *times) in rows.items():  # the first compiles
        print(f"{name:<28}{statistics.median(times):>8.0f} us ({min(times):.0f} to {max(times):.0f})")


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=10.0, help="length of the recording")
    options.add_argument("--part", type=float, default=1.0, help="seconds of it that the peer simulates")
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--calls", type=int, default=0, help="turns of single calls, in place of the comparison")
    chosen = options.parse_args()
    twin, log = plain_twin(), recording(chosen.seconds)
    if chosen.calls:
        print_calls(log, chosen.calls)
        return
    part = round(chosen.part * 1000)
    u = np.column_stack([log["duty_supply"], log["duty_exhaust"]])[:part]
    reference = twin.radau(log.time[:part], u, [log["position"][0], 0.0, 1.095e5, 1.095e5, 0.0], THETA)[:, 0]
    fit(log)
    own, peer = [], []
    for _ in range(chosen.rounds):
        begin = time.perf_counter()
        result = fit(log)
        own.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        position = peer_simulation(twin, log, part)
        peer.append((time.perf_counter() - begin) * chosen.seconds / chosen.part)
    count = peer_evaluations(log)
    simulated = simulate(Actuator(load=Load(THETA)), log).log["position"][:part]
    ratios = sorted(p * count / o for o, p in zip(own, peer, strict=True))
    rows = [
        ("clutchid", statistics.median(own), np.abs(simulated - reference).max()),
        ("SciPy, scaled", statistics.median(peer) * count, np.abs(position - reference).max()),
    ]
    print(f"{'whole fit':<16}{'time [s]':>12}{'error of one simulation [µm]':>32}")
    for name, seconds, error in rows:
        print(f"{name:<16}{seconds:>12.3f}{error * 1e6:>32.3f}")
    print(
        f"ratio {statistics.median(ratios):.0f} (from {ratios[0]:.0f} to {ratios[-1]:.0f} over {chosen.rounds} rounds)"
    )
    print(f"the peer's simulation was timed on {chosen.part:g} s of {chosen.seconds:g} s; its search needs {count}")
    estimates = ", ".join(f"{n} {e}" for n, e in result.parameters.items())
    print(f"clutchid: {result.evaluations} evaluations, {estimates}; true {THETA} in N/m")


if __name__ == "__main__":
    main()
