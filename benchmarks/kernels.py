"""Speed of the Numba kernels against C, in paired runs on one log: ``python benchmarks/kernels.py``.

The C is the project's own, compiled with ``gcc -O3 -march=native -ffast-math``. All variants run in turn, round after
round, so that what else the machine does hits them alike; the ratio of a round is free of slow drifts. Last comes what
a calibration waits for: windows of 100 samples of the richest model, with derivatives to all that it can free.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.c99 import c99_source
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.model.isothermal import isothermal
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters

FloatArray = NDArray[np.float64]
FLAGS = ("-std=c99", "-O3", "-march=native", "-ffast-math", "-fPIC")
NONE = np.zeros(0, np.int64)

#: The richest model, the samples of a window, and the parameters that it does not know.
RICH, WINDOW, SENSORS = "energy-balance-stribeck", 100, ("tau_y", "tau_p", "e_y", "e_p")


@dataclass(frozen=True)
class Drive:
    """What every kernel is given: held inputs, parameters, load table and the start at rest."""

    u: FloatArray
    dt: FloatArray
    substeps: NDArray[np.int32]
    p: FloatArray
    breakpoints: FloatArray
    load: FloatArray
    basis: FloatArray
    x0: FloatArray


def clutch() -> Actuator:
    """The paper's actuator, with a load of all three weights."""
    return Actuator().replace({"theta_2": -0.58e5, "theta_3": 0.39e5})


def drive(seconds: float, rate: float, seed: int) -> Drive:
    """Strokes, holds and releases of random strength, drawn from `seed`, sampled with `rate` Hz."""
    random = np.random.default_rng(seed)
    n = round(seconds * rate) + 1
    u = np.zeros((n, 2))
    at = 0
    while at < n:
        for valve in (0, 1):  # fill, hold, release, hold
            length = int(random.uniform(0.05, 0.4) * rate)
            u[at : at + length, valve] = random.uniform(0.1, 1.0)
            at += length + int(random.uniform(0.05, 0.5) * rate)
    actuator = clutch()
    ambient = actuator.parameters.P_0
    return Drive(
        u=u,
        dt=np.full(n - 1, 1.0 / rate),
        substeps=np.ones(n - 1, np.int32),
        p=actuator.parameters.array(),
        breakpoints=actuator.load.breakpoints,
        load=actuator.load.combined(),
        basis=np.ascontiguousarray(actuator.load.coefficients),
        x0=np.array([0.0, 0.0, ambient, ambient, 0.0]),
    )


def numba_run(d: Drive, out: FloatArray) -> Callable[[], int]:
    """The kernel without sensitivities."""
    module, n = kernels("isothermal"), out.shape[0]
    jump, measured = np.zeros(n, np.uint8), np.zeros((n, 2))
    return lambda: module.run(d.x0.copy(), d.u, d.p, d.dt, d.substeps, jump, measured, d.breakpoints, d.load, out)


def numba_table(d: Drive, out: FloatArray) -> Callable[[], int]:
    """The kernel with the derivatives to the three load weights."""
    return _with_columns(d, out, 3, np.arange(3), ())


def numba_all(d: Drive, out: FloatArray) -> Callable[[], int]:
    """The kernel with the derivatives to the 25 parameters A_A ... B_out of the Appendix."""
    chosen = Parameters.names()[: Parameters.names().index("B_out") + 1]
    slots = kernels("isothermal").SLOTS
    fills = [(number, row, column) for number, (row, column) in enumerate(slots) if column < len(chosen)]
    return _with_columns(d, out, len(chosen), NONE, fills)


def _with_columns(
    d: Drive, out: FloatArray, columns: int, table: NDArray[np.int64], fills: Sequence[tuple[int, int, int]]
) -> Callable[[], int]:
    kernel, n = kernels("isothermal").run_all, out.shape[0]
    jump, measured = np.zeros(n, np.uint8), np.zeros((n, 2))
    fill = np.array(fills, np.int64).reshape(-1, 3).T.copy()
    sens, watched, S = np.zeros((n, 1, columns)), np.array([0]), np.zeros((5, columns))

    def run() -> int:
        S[:] = 0.0
        status: int = kernel(
            d.x0.copy(), S, d.u, d.p, d.dt, d.substeps, jump, measured, d.breakpoints, d.load, d.basis,
            table, table, *fill, watched, out, sens,
        )  # fmt: skip
        return status

    return run


def windows(d: Drive, names: Sequence[str]) -> Callable[[], int]:
    """Ten states over windows of 100 samples, with the derivatives to three load weights and the parameters `names`."""
    actuator = Actuator(model=RICH)
    p, load = actuator.parameters, actuator.load
    at = {"p_A": p.P_0, "p_B": p.P_0, "T_A": p.T_w, "T_B": p.T_w, "p_S": p.P_S, "p_G": p.P_S}
    x, columns = np.array([at.get(state, 0.0) for state in VARIANTS[RICH]]), len(names) + 3
    place = {Parameters.names().index(name): 3 + c for c, name in enumerate(names)}
    fills = [(i, row, place[q]) for i, (row, q) in enumerate(kernels(RICH).SLOTS) if q in place]
    fill = np.array(fills, np.int64).reshape(-1, 3).T.copy()
    u = np.zeros((d.u.shape[0], len(kernels(RICH).INPUTS)))
    u[:, :2], u[:, 3], u[:, 4:] = d.u, 1e-3 / p.T_pwm if p.T_pwm else 0.0, np.roll(d.u, 10, axis=0)
    out, sens, weights = np.empty((WINDOW, x.size)), np.empty((WINDOW, 2, columns)), np.arange(3)
    jump, measured, watched = np.zeros(WINDOW, np.uint8), np.zeros((WINDOW, 2)), np.array([0, 2])
    basis = np.ascontiguousarray(load.coefficients)
    free = (weights, weights, *fill)
    table, samples = (load.breakpoints, load.combined()), (jump, measured)

    def run() -> int:
        state = x.copy()
        for k in range(0, u.shape[0] - WINDOW, WINDOW):
            common = (u[k : k + WINDOW], p.array(), d.dt[k : k + WINDOW - 1], d.substeps[k : k + WINDOW - 1], *samples)
            if names:
                S = np.zeros((x.size, columns))
                failed: int = kernels(RICH).run_all(state, S, *common, *table, basis, *free, watched, out, sens)
            else:
                failed = kernels(RICH).run(state, *common, *table, out)
            if failed >= 0:
                return failed
        return -1

    return run


class Table(ctypes.Structure):
    """isothermal_table_t."""

    _fields_ = (("n", ctypes.c_int), ("breakpoints", ctypes.c_void_p), ("coefficients", ctypes.c_void_p))


def c_run(d: Drive, out: FloatArray, folder: Path) -> Callable[[], int]:
    """The same in C, compiled in `folder`, on the same arrays."""
    code = c99_source(isothermal())
    (folder / "isothermal.h").write_text(code.header)
    (folder / "isothermal.c").write_text(code.source)
    subprocess.run(["gcc", *FLAGS, "-c", "isothermal.c"], cwd=folder, check=True)
    # Linked without -ffast-math: with it gcc before 13 adds start code that makes the whole process, Numba too, flush
    # small numbers to zero as soon as the library is loaded.
    subprocess.run(["gcc", "-shared", "-o", "isothermal.so", "isothermal.o", "-lm"], cwd=folder, check=True)
    function = ctypes.CDLL(str(folder / "isothermal.so")).isothermal_run
    table = Table(d.breakpoints.size, d.breakpoints.ctypes.data, d.load.ctypes.data)

    def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    rest = (
        pointer(d.u),
        pointer(d.p),
        pointer(d.dt),
        pointer(d.substeps),
        out.shape[0],
        ctypes.byref(table),
        pointer(out),
    )

    def run() -> int:
        x = d.x0.copy()
        status: int = function(pointer(x), *rest)
        return status

    return run


def paired_times(variants: Sequence[Callable[[], int]], rounds: int) -> FloatArray:
    """Seconds of every variant in every round, shape (rounds, variants), after one round to warm up."""
    times = np.zeros((rounds + 1, len(variants)))
    for number in range(rounds + 1):
        for column, run in enumerate(variants):
            start = time.perf_counter()
            status = run()
            times[number, column] = time.perf_counter() - start
            if status != -1:
                raise RuntimeError(f"variant {column} left the finite numbers at sample {status}.")
    return times[1:]


def report(names: Sequence[str], times: FloatArray, pairs: Sequence[tuple[int, int, float]]) -> str:
    """The table of medians with quartiles, and of the ratios with their targets."""
    lines = ["variant              median ms    quartiles ms        min .. max ms"]
    for name, column in zip(names, times.T * 1e3, strict=True):
        low, mid, high = np.quantile(column, [0.25, 0.5, 0.75])
        lines.append(f"{name:20s} {mid:9.3f}    {low:.3f} .. {high:.3f}    {column.min():.3f} .. {column.max():.3f}")
    lines.append("\nratio                             of medians   pairwise median (quartiles)   target")
    for over, under, target in pairs:
        low, mid, high = np.quantile(times[:, over] / times[:, under], [0.25, 0.5, 0.75])
        whole = np.median(times[:, over]) / np.median(times[:, under])
        verdict = "met" if mid <= target else "MISSED"
        name = f"{names[over]} / {names[under]}"
        lines.append(f"{name:34s} {whole:9.3f}   {mid:.3f} ({low:.3f} .. {high:.3f})    <= {target:g} {verdict}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=100, help="paired runs, at least 50 for the record")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the log")
    parser.add_argument("--rate", type=float, default=1000.0, help="samples a second")
    parser.add_argument("--seed", type=int, default=1, help="of the duty cycles")
    options = parser.parse_args()
    d = drive(options.seconds, options.rate, options.seed)
    outs = [np.zeros((d.u.shape[0], 5)) for _ in range(4)]
    with tempfile.TemporaryDirectory() as folder:
        variants = [
            c_run(d, outs[0], Path(folder)),
            numba_run(d, outs[1]),
            numba_table(d, outs[2]),
            numba_all(d, outs[3]),
            windows(d, ()),
            windows(d, [name for name in Parameters.names() if name not in SENSORS]),
        ]
        times = paired_times(variants, options.rounds)
    names = ("C", "run", "3 columns", "25 columns", "ten states", f"{len(Parameters.names()) - 1} columns")
    print(report(names, times, [(1, 0, 1.2), (2, 1, 4.0), (3, 1, 20.0), (5, 4, 20.0)]))
    print("\nlargest difference between the states of C and of run:")
    for name, value, other in zip(("y", "v", "p_A", "p_B", "z"), outs[0].T, outs[1].T, strict=True):
        print(f"  {name:4s} {np.abs(value - other).max():.2e} of {np.abs(other).max():.3g}")


if __name__ == "__main__":
    main()
