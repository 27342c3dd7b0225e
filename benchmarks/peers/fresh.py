"""A fit as a process of its own: ``python fresh.py PEER``, in a folder with its recording; weights in N/m come out."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from plain import WEIGHTS, FloatArray, Model, Recording, casadi_run, jax_run, scipy_position, searched

GIVEN = np.load("given.npz")
U, MEASURED, START, X0 = GIVEN["u"], GIVEN["measured"], GIVEN["start"], GIVEN["x0"]
NOISE, STEP = float(GIVEN["noise"]), 1e-3


def clutchid() -> FloatArray:
    """`clutchid.fit`."""
    from clutchid import Actuator, Load, Log, fit

    log = Log(GIVEN["time"], {"duty_supply": U[:, 0], "duty_exhaust": U[:, 1], "position": MEASURED})
    estimates = fit(log, Actuator(load=Load(tuple(START))), free="load").parameters
    return np.array([estimates[name].value for name in WEIGHTS])


def scipy() -> FloatArray:
    """LSODA and `least_squares` with differences."""
    recording = Recording(GIVEN["breakpoints"], GIVEN["basis"], GIVEN["time"], U, X0, GIVEN["edges"].tolist())
    return searched(NOISE, scipy_position(Path("rates.py").read_text(), recording, "LSODA"))(MEASURED, START)


def model() -> Model:
    """The model for a peer that records expressions."""
    return Model(Path("chosen.py").read_text(), WEIGHTS, {}, GIVEN["breakpoints"], GIVEN["basis"])


def casadi() -> FloatArray:
    """CasADi's compiled Runge-Kutta and `least_squares`; its library stays in the folder."""
    import casadi as ca

    n, library = len(U) - 1, Path("run.so")
    if not library.exists():
        maker = ca.CodeGenerator("run.c")
        for name, columns in (("plain", False), ("moved", True)):
            maker.add(casadi_run(model(), name, n, STEP, 1, columns))
        maker.generate()
        flags = ("-O3", "-march=native", "-ffast-math", "-fPIC", "-w", "-shared")
        subprocess.run(["gcc", *flags, "-o", library, "run.c", "-lm"], check=True)
    plain, moved = (ca.external(name, "./run.so") for name in ("plain", "moved"))
    inputs = ca.DM(U[:-1].T)

    def position(theta: FloatArray) -> FloatArray:
        return np.append(X0[0], plain(X0, inputs, theta).full()[0])

    def jacobian(theta: FloatArray) -> FloatArray:
        return np.vstack([np.zeros(3), moved(np.append(X0, np.zeros(15)), inputs, theta).full()[5::5].T])

    return searched(NOISE, position, jacobian)(MEASURED, START)


def jax() -> FloatArray:
    """JAX's loop and `least_squares`; what it compiles stays in the folder."""
    os.environ |= {
        "JAX_COMPILATION_CACHE_DIR": "compiled", "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    }  # fmt: skip
    import jax

    states = jax_run(model(), X0, U, STEP, 1)
    position = jax.jit(lambda q: states(q)[:, 0])
    jacobian = jax.jit(jax.jacfwd(position))
    estimate = searched(NOISE, lambda q: np.asarray(position(q)), lambda q: np.asarray(jacobian(q)))
    return estimate(MEASURED, START)


PEERS: dict[str, Callable[[], FloatArray]] = {"clutchid": clutchid, "scipy": scipy, "casadi": casadi, "jax": jax}

if __name__ == "__main__":
    print(*PEERS[sys.argv[1]]())
