"""GNU Octave as a peer: the right-hand side as a function file, and programs that run in a process of its own."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from equations import octave_rates
from peer import FloatArray
from plain import STEP, TOLERANCE, UNIT, USUAL, Recording
from problem import NOISE, Problem

COMMAND = ("octave-cli", "--norc", "--quiet")

#: Reads the recording, and simulates it with `ode45`, anew from every edge of an input.
SIMULATION = r"""
1;
f = fopen('time'); time = fread(f, Inf, 'double'); fclose(f);
f = fopen('inputs'); u = fread(f, [2, Inf], 'double'); fclose(f);
f = fopen('edges'); edges = fread(f, Inf, 'double') + 1; fclose(f);
function states = simulated(table, time, u, edges)
    options = odeset('RelTol', RTOL, 'AbsTol', ATOL);
    states = zeros(numel(time), 5); states(1, :) = START;
    for k = 1:numel(edges) - 1
        a = edges(k); b = edges(k + 1); v = u(1, a); w = u(2, a);
        [t, x] = ode45(@(t, x) rates(x, v, w, table), time(a:b), states(a, :)', options);
        if (b == a + 1) x = x([1, end], :); end
        states(a:b, :) = x;
    end
end
"""

#: One simulation, with the time that it takes.
ONCE = r"""
table.b = BREAKPOINTS; table.c = COEFFICIENTS;
clock = tic;
states = simulated(table, time, u, edges);
printf('seconds %.9f\n', toc(clock));
f = fopen('states', 'w'); fwrite(f, states', 'double'); fclose(f);
"""

#: Load weights from the measured position by `lsqnonlin` on differences.
SEARCH = r"""
pkg load optim
f = fopen('measured'); measured = fread(f, Inf, 'double'); fclose(f);
f = fopen('start'); start = fread(f, Inf, 'double'); fclose(f);
function e = residuals(q, measured, time, u, edges)
    table.b = BREAKPOINTS; table.c = UNIT * (q(1) * BASIS_1 + q(2) * BASIS_2 + q(3) * BASIS_3);
    e = (simulated(table, time, u, edges)(:, 1) - measured) / SIGMA;
end
options = optimset('FinDiffRelStep', STEP);
q = lsqnonlin(@(q) residuals(q, measured, time, u, edges), start / UNIT, [0; -Inf; 0], [Inf; Inf; Inf], options);
printf('%.17g %.17g %.17g\n', q * UNIT);
"""


def matrix(rows: FloatArray) -> str:
    """The numbers of a matrix in Octave's own form."""
    return "[" + "; ".join(" ".join(map(repr, map(float, row))) for row in np.atleast_2d(rows)) + "]"


def write_simulation(problem: Problem, folder: Path) -> None:
    """`once.m` in a folder, with what it reads; it leaves the states there."""
    numbers = {"BREAKPOINTS": matrix(problem.drive.breakpoints), "COEFFICIENTS": matrix(problem.drive.load)}
    _write(problem, folder, "once.m", SIMULATION + ONCE, numbers)


def write_search(problem: Problem, folder: Path, measured: FloatArray, start: FloatArray) -> None:
    """`search.m` in a folder, with what it reads; it prints weights in N/m."""
    recording: Recording = problem.given
    basis = {f"BASIS_{k}": matrix(values) for k, values in enumerate(recording.basis, 1)}
    numbers = {
        "SIGMA": repr(NOISE),
        "UNIT": repr(UNIT),
        "STEP": repr(STEP),
        "BREAKPOINTS": matrix(recording.breakpoints),
    }
    _write(problem, folder, "search.m", SIMULATION + SEARCH, numbers | basis)
    measured.tofile(folder / "measured")
    start.tofile(folder / "start")


def _write(problem: Problem, folder: Path, name: str, program: str, numbers: Mapping[str, str]) -> None:
    """A program and the right-hand side in a folder, and the arrays that every program reads."""
    tolerances = {"RTOL": repr(TOLERANCE), "ATOL": matrix(TOLERANCE * 1e-2 * USUAL), "START": matrix(problem.drive.x0)}
    replacements = tolerances | numbers
    (folder / "rates.m").write_text(octave_rates(problem.values))
    (folder / name).write_text(
        re.sub(rf"\b({'|'.join(replacements)})\b", lambda match: replacements[match[0]], program)
    )
    problem.time.tofile(folder / "time")
    np.ascontiguousarray(problem.drive.u).tofile(folder / "inputs")
    np.array(problem.edges, float).tofile(folder / "edges")


def printed(folder: Path, name: str) -> str:
    """What a program in a folder prints."""
    process = subprocess.run([*COMMAND, name], cwd=folder, check=False, capture_output=True, text=True)
    if process.returncode:
        raise RuntimeError(process.stderr[-200:])
    return process.stdout
