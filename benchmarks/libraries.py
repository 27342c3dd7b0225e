"""What is written by hand against the library that would do it: ``python benchmarks/libraries.py [--only csv,bus]``.

CSV dialects against polars, frames of a bus against cantools and python-can, small triangular factors against LAPACK, a
search against SciPy's, stiffness against eigenvalues. Times are processor times, the least of some alternating runs.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import clutchid

#: A table of what was measured: what it does, ours, the library.
Rows = Iterator[tuple[str, str, str]]

ROUNDS = 5


def seconds(*calls: Callable[[], object]) -> list[float]:
    """Least processor time of each call; they take turns, so that a busy machine slows all of them."""
    for call in calls:
        call()
    least = [np.inf] * len(calls)
    for _ in range(ROUNDS):
        for number, call in enumerate(calls):
            begin = time.process_time()
            call()
            least[number] = min(least[number], time.process_time() - begin)
    return [float(value) for value in least]


def csv() -> Rows:
    """A recording of 11 MB in five dialects: ours by itself, polars by its defaults and with options by hand."""
    import polars as pl

    log = clutchid.bundled_recording()
    names = ["time", "position", "duty_supply", "duty_exhaust", "pressure_a"]
    values = np.column_stack([log.time, *(log[name] for name in names[1:])])
    values = np.vstack([values + np.array([30.0 * i, 0, 0, 0, 0]) for i in range(10)])
    units = ["s", "m", "1", "1", "Pa"]
    lines = [",".join(f"{value:.9g}" for value in row) for row in values]
    head = ",".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
    german = [line.replace(",", ";").replace(".", ",") for line in lines]
    dialects = {
        "plain": ([head, *lines], "utf-8", {}),
        "semicolon, decimal comma": (
            [head.replace(",", ";"), *german], "utf-8", {"separator": ";", "decimal_comma": True},
        ),
        "Windows-1252, lines above the names": (
            ["Prüfstand;7", "Fahrer;Müller", head.replace(",", ";"), *german], "cp1252",
            {"separator": ";", "decimal_comma": True, "skip_rows": 2, "encoding": "cp1252"},
        ),
        "units in a row of their own": (
            [",".join(names), ",".join(units), *lines], "utf-8", {"skip_rows_after_header": 1},
        ),
        "tabs, comments above": (
            ["# logger 3", "# 2026", head.replace(",", "\t"), *(line.replace(",", "\t") for line in lines)], "utf-8",
            {"separator": "\t", "comment_prefix": "#"},
        ),
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for name, (text, encoding, by_hand) in dialects.items():
            options = {**by_hand, "schema_overrides": [pl.Float64] * 5}  # "0" may be the first of a column of fractions
            path = Path(folder) / "log.csv"
            path.write_text("\n".join(text) + "\n", encoding=encoding)
            right = _right(lambda path=path: clutchid.read(path)["position"], values[:, 1])
            default = _right(lambda path=path: pl.read_csv(path).to_numpy()[:, 1], values[:, 1])
            typed = _right(lambda path=path, o=options: pl.read_csv(path, **o).to_numpy()[:, 1], values[:, 1])
            ours, theirs = seconds(
                lambda path=path: clutchid.read(path), lambda path=path, o=options: pl.read_csv(path, **o)
            )
            what = f"CSV, {path.stat().st_size / 1e6:.0f} MB, {name}"
            yield what, f"{right}, {1e3 * ours:.0f} ms", f"{default}; with options {typed}, {1e3 * theirs:.0f} ms"


def _right(read: Callable[[], object], expected: np.ndarray) -> str:
    """Whether a reader returns the expected column, and what it does otherwise."""
    try:
        column = np.asarray(read())
    except Exception as error:
        return f"refused ({type(error).__name__})"
    if column.shape != expected.shape or not np.issubdtype(column.dtype, np.number):
        return f"wrong ({column.dtype} {column.shape[0]})"
    return "right" if np.allclose(column, expected, rtol=1e-8) else "wrong numbers"


_DBC = """VERSION ""
BO_ 256 State: 8 TCU
 SG_ position : 0|16@1+ (0.001,0) [0|64] "mm" LOG
 SG_ speed : 16|16@1- (0.01,0) [-300|300] "mm/s" LOG
 SG_ supply : 32|16@1+ (0.01,0) [0|100] "%" LOG
 SG_ exhaust : 48|16@1+ (0.01,0) [0|100] "%" LOG
"""


def bus(count: int = 100_000) -> Rows:
    """Frames of four signals: decoded one by one by cantools and in bulk; logs of candump by python-can and by ours."""
    import can
    import cantools

    from clutchid.measurements.formats.can.dbc import decode, messages_in
    from clutchid.measurements.formats.can.texts import candump_log

    data = np.random.default_rng(0).integers(0, 256, (count, 8), dtype=np.uint8)
    frames = [row.tobytes() for row in data]
    message = cantools.database.load_string(_DBC, "dbc").get_message_by_name("State")
    signals = [signal for group in messages_in(_DBC)[0].groups for signal in group.signals]
    lengths = np.full(count, 8)
    ours, theirs = seconds(
        lambda: [decode(signal, data, lengths) for signal in signals],
        lambda: [message.decode(frame) for frame in frames],
    )
    yield (
        f"{count:,} frames of four signals",
        f"{1e6 * ours / count:.2f} µs each",
        f"{1e6 * theirs / count:.2f} µs each",
    )
    plain = [f"({1e-3 * i:.6f}) can0 100#{frame.hex().upper()}" for i, frame in enumerate(frames)]
    spaced = [f" (2026-01-31 12:00:{i % 60:02d}.000000)  can0  100   [8]  {frame.hex(' ').upper()}"
              for i, frame in enumerate(frames)]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("candump -L", plain), ("candump -tA", spaced)):
            path = Path(folder) / "bus.log"
            path.write_text("\n".join(text) + "\n", encoding="ascii")

            def by_library(path: Path = path) -> int:
                with can.CanutilsLogReader(path) as reader:
                    return sum(1 for _ in reader)

            def by_ours(path: Path = path) -> int:
                return sum(len(block) for block in candump_log(path).blocks())

            number = _counted(by_library)
            ours = seconds(by_ours)[0]
            theirs = f", {1e6 * seconds(by_library)[0] / count:.1f} µs each" if number == str(count) else ""
            yield (
                f"{count:,} lines of {name}",
                f"{_counted(by_ours)}, {1e6 * ours / count:.1f} µs each",
                number + theirs,
            )


def _counted(read: Callable[[], int]) -> str:
    try:
        return str(read())
    except Exception as error:
        return f"refused ({type(error).__name__})"


def triangular() -> Rows:
    """Triangular factors of the sizes of windows and of whole problems."""
    from clutchid.codegen.kernels import kernels_in

    kernel = kernels_in("clutchid.numerics.householder").triangularise
    for shape in ((20, 12), (110, 30), (110, 70), (30_000, 60)):
        A = np.random.default_rng(0).standard_normal(shape)
        factor = np.empty((min(shape), shape[1]))
        repeats = max(1, 2_000_000 // (shape[0] * shape[1] ** 2))
        ours, theirs = seconds(
            lambda A=A, R=factor, n=repeats: [kernel(A, R) for _ in range(n)],
            lambda A=A, n=repeats: [np.linalg.qr(A, mode="r") for _ in range(n)],
        )
        yield (
            f"factor of {shape[0]:,} x {shape[1]}",
            f"{1e6 * ours / repeats:,.0f} µs",
            f"{1e6 * theirs / repeats:,.0f} µs",
        )


def search() -> Rows:
    """Load weights, and with four parameters, from 10 s of position, by the same simulation and exact derivatives."""
    from scipy.optimize import least_squares

    from clutchid.numerics.least_squares import Linearisation, compress, minimise

    log, actuator = clutchid.bundled_recording().slice(0, 10_000), clutchid.Actuator()
    for names in (["theta_1", "theta_2", "theta_3"], ["theta_1", "theta_2", "theta_3", "D_v", "F_C", "C_vs", "C_ve"]):
        start = np.array([actuator.value(name) for name in names])
        low = np.array([{"theta_1": 0.0, "theta_2": -np.inf, "theta_3": 0.0}.get(name, 0.05) for name in names])
        size = np.where(start == 0.0, 1e5, np.abs(start))
        calls = [0]

        def at(x: np.ndarray, names: list[str] = names, size: np.ndarray = size, calls: list[int] = calls) -> tuple:
            calls[0] += 1
            values = dict(zip(names, (x * size).tolist(), strict=True))
            run = clutchid.simulate(actuator.replace(values), log, sensitivities=names)
            jacobian = np.column_stack([run.sensitivities[name][:, 0] for name in names]) * size
            return (run.log["position"] - log["position"]) / 1e-4, jacobian / 1e-4

        def ours(
            at: Callable = at, start: np.ndarray = start, size: np.ndarray = size, low: np.ndarray = low
        ) -> object:
            def evaluate(x: np.ndarray) -> Linearisation:
                r, J = at(x)
                factor = compress(J, r)
                return Linearisation(factor[:-1, :-1], factor[:-1, -1], 0.5 * float(r @ r), r.size)

            return minimise(
                evaluate, (start / size, evaluate(start / size)), low, np.full(low.size, np.inf), tolerance=1e-9
            )

        def theirs(
            at: Callable = at, start: np.ndarray = start, size: np.ndarray = size, low: np.ndarray = low
        ) -> object:
            last: dict[bytes, tuple] = {}

            def evaluated(x: np.ndarray) -> tuple:
                if x.tobytes() not in last:
                    last.clear()
                    last[x.tobytes()] = at(x)
                return last[x.tobytes()]

            return least_squares(
                lambda x: evaluated(x)[0], start / size, lambda x: evaluated(x)[1], (low, np.inf), x_scale="jac",
                ftol=1e-9, xtol=1e-9, gtol=1e-9,
            )  # fmt: skip

        costs, counts = [], []
        for call in (ours, theirs):
            calls[0] = 0
            solution = call()
            counts.append(calls[0])
            costs.append(solution.at.cost if hasattr(solution, "at") else solution.cost)
        times = seconds(ours, theirs)
        yield f"search for {len(names)}", *(
            f"cost {cost:.6g}, {count} evaluations, {1e3 * took:.0f} ms"
            for cost, count, took in zip(costs, counts, times, strict=True)
        )  # fmt: skip


def stiffness() -> Rows:
    """Spectral radius of matrices of ten states, as the steps of a simulation need it."""
    from clutchid.codegen.kernels import kernels_in

    matrices = np.random.default_rng(0).standard_normal((200, 10, 10))
    kernel, scale = kernels_in("clutchid.numerics.spectral_radius").spectral_radius, np.ones(10)
    ours, theirs = seconds(
        lambda: [kernel(matrices, scale) for _ in range(10)],
        lambda: [np.abs(np.linalg.eigvals(matrices)).max() for _ in range(10)],
    )
    yield "largest spectral radius of 200 matrices 10 x 10", f"{1e5 * ours:.0f} µs", f"{1e5 * theirs:.0f} µs"


PARTS = {"csv": csv, "bus": bus, "triangular": triangular, "search": search, "stiffness": stiffness}


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas")
    print("| what | by hand | library |\n|---|---|---|")
    for part in parser.parse_args().only.split(","):
        for row in PARTS[part]():
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
