"""Filters of part (e) in C: a program that follows a recording and times each step."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from ekf import Followed, archimedes_step, casadi_step
from peer import FloatArray

from clutchid.exports.c99 import CStyle, Real, observer_c99, source_files
from clutchid.exports.parity import microseconds
from clutchid.observer import Observer, start

FLAGS = ("-O3",)


class Steps(NamedTuple):
    """A pass over a recording: seconds and pressure by sample, load weights at the end, s of a reading of the clock."""

    seconds: FloatArray
    pressure: FloatArray
    weights: FloatArray
    clock: float


class Filter(NamedTuple):
    """The lines of a filter in the program.

    `state` declares, `start` begins with `first` (x, then P by row), `given` takes sample i from `in`, before the clock
    starts, and `step` is what is timed; `pressure` and `weights` are expressions. Columns of `in` are 0: position, 1
    and 2: duty cycles before the sample, 3 and 4: from it on, 5: microseconds since the last one, 6 to 13: variances.
    """

    include: str
    state: str
    start: str
    given: str
    step: str
    pressure: str
    weights: str


PROGRAM = r"""
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include "INCLUDE"

enum { columns = 14, n = SAMPLES, readings = 10000 };
static double first[72], in[n][columns], took[n], pressure[n], idle[readings];
STATE

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e-9 * (double)t.tv_nsec + (double)(t.tv_sec % 100000);
}

int main(void)
{
    if (fread(first, sizeof first, 1, stdin) != 1 || fread(in, sizeof in, 1, stdin) != 1) return 1;
    START
    pressure[0] = first[2];
    for (int i = 0; i < readings; i++) {
        const double begin = now();
        idle[i] = now() - begin;
    }
    for (int i = 1; i < n; i++) {
        GIVEN
        const double begin = now();
        STEP
        took[i] = now() - begin;
        pressure[i] = PRESSURE;
    }
    const double weights[3] = { WEIGHTS };
    fwrite(took, sizeof took, 1, stdout);
    fwrite(pressure, sizeof pressure, 1, stdout);
    fwrite(weights, sizeof weights, 1, stdout);
    fwrite(idle, sizeof idle, 1, stdout);
    return 0;
}
"""


def runner(followed: Followed, sources: Mapping[str, str], lines: Filter) -> Callable[[], Steps]:
    """The compiled program as a run; `sources` are the files of the filter."""
    folder, n = Path(tempfile.mkdtemp()), len(followed.log)
    text = PROGRAM.replace("SAMPLES", str(n))
    for name, value in lines._asdict().items():
        text = text.replace(name.upper(), value)
    for name, content in {**sources, "main.c": text}.items():
        (folder / name).write_text(content, encoding="utf-8")
    files = sorted(path.name for path in folder.glob("*.c"))
    subprocess.run(["gcc", *FLAGS, "-w", "-o", "follow", *files, "-lm"], cwd=folder, check=True)
    prior, duties = followed.prior, followed.duties
    before = np.vstack([np.zeros(2), duties[:-1]])
    samples = np.column_stack([followed.log["position"], before, duties, microseconds(followed.log), prior.Q])
    data = np.concatenate([prior.x, prior.P.ravel(), samples.ravel()]).tobytes()

    def run() -> Steps:
        ended = subprocess.run([folder / "follow"], input=data, check=True, capture_output=True)
        took, pressure, weights, idle = np.split(np.frombuffer(ended.stdout), [n, 2 * n, 2 * n + 3])
        return Steps(took, pressure, weights, float(np.median(idle)))

    return run


def exported(followed: Followed, every_sample: bool, real: Real) -> Callable[[], Steps]:
    """clutchid's exported C."""
    joint: Observer = followed.every_sample if every_sample else followed.shipped
    sources = source_files(observer_c99(joint, start(joint), CStyle(real=real), "side by side"))
    lines = Filter(
        include="clutch.h",
        state="static clutch_t self; static clutch_output_t output;",
        start=f"""clutch_start(&clutch_data, &self, NULL, 0u);
    const clutch_input_t at_rest = {{ ({real})in[0][0], ({real})in[0][3], ({real})in[0][4], ({real})NAN }};
    clutch_fast(&clutch_data, &self, &at_rest, 0u, &output);""",
        given=f"const clutch_input_t input = {{ ({real})in[i][0], ({real})in[i][3], ({real})in[i][4], ({real})NAN }};",
        step="clutch_fast(&clutch_data, &self, &input, (uint32_t)in[i][5], &output);",
        pressure="output.pressure_a",
        weights=", ".join(f"self.belief[self.active].theta[{i}]" for i in range(3)),
    )
    run = runner(followed, sources, lines)

    def in_si() -> Steps:
        states = run()
        return states._replace(weights=np.asarray(joint.actuator.load.theta) + joint.prior.weights @ states.weights)

    return in_si


def casadi_in_c(followed: Followed) -> Callable[[], Steps]:
    """The C that CasADi writes."""
    import casadi as ca

    step = casadi_step(followed)
    with tempfile.TemporaryDirectory() as folder:
        maker = ca.CodeGenerator("ekf.c", {"with_header": True})
        maker.add(step)
        maker.generate(f"{folder}/")
        sources = {path.name: path.read_text(encoding="utf-8") for path in Path(folder).iterdir()}
    sizes = step.sz_arg(), step.sz_res(), max(step.sz_iw(), 1), max(step.sz_w(), 1)
    lines = Filter(
        include="ekf.h",
        state=f"static double x[8], P[64], w[{sizes[3]}]; static casadi_int iw[{sizes[2]}];",
        start="memcpy(x, first, sizeof x); memcpy(P, first + 8, sizeof P);",
        given=f"const double *arg[{sizes[0]}] = {{ x, P, &in[i][1], &in[i][0], &in[i][6] }}; "
        f"double *res[{sizes[1]}] = {{ x, P }};",
        step="ekf(arg, res, iw, w, 0);",
        pressure="x[2]",
        weights="x[5], x[6], x[7]",
    )
    return runner(followed, sources, lines)


def archimedes_in_c(followed: Followed, all_scalar: bool) -> Callable[[], Steps]:
    """The C that Archimedes writes, in double."""
    import archimedes

    prior = followed.prior
    step = archimedes_step(followed, all_scalar)
    shapes = prior.x, prior.P, followed.duties[0], np.zeros(1), prior.Q[0]
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.chdir(folder):
            archimedes.codegen(step, shapes, float_type=np.float64)
        sources = {path.name: path.read_text(encoding="utf-8") for path in Path(folder).iterdir()}
    lines = Filter(
        include="ekf.h",
        state="static ekf_arg_t arg; static ekf_res_t res; static ekf_work_t work;",
        start="ekf_init(&arg, &res, &work); "
        "memcpy(arg.x, first, sizeof arg.x); memcpy(arg.P, first + 8, sizeof arg.P);",
        given="memcpy(arg.u, &in[i][1], sizeof arg.u); arg.z[0] = in[i][0]; memcpy(arg.q, &in[i][6], sizeof arg.q);",
        step="ekf_step(&arg, &res, &work); "
        "memcpy(arg.x, res.x_new, sizeof arg.x); memcpy(arg.P, res.P_new, sizeof arg.P);",
        pressure="arg.x[2]",
        weights="arg.x[5], arg.x[6], arg.x[7]",
    )
    return runner(followed, sources, lines)
