"""What all tests share: folders, the compiled kernels, and a synthetic recording whose truth is known."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from compileall import compile_dir
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from importlib.util import cache_from_source, find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.assertion import rewrite
from _pytest.doctest import DoctestModule
from hypothesis import settings

import clutchid
from clutchid.inference.filter.filtering import compile_filter
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.compiled import compile_ahead, kernels, system
from clutchid.model.variants import VARIANTS
from fixtures import programs
from fixtures.commands import without_workers
from fixtures.compilers import compilers
from fixtures.export_c import equations_once
from fixtures.model_recordings import (  # noqa: F401, fixtures of several packages
    adapted,
    calibrated,
    cost_at,
    drive_log,
    duties_of,
    plant,
    problem_of,
    recorded_by,
    starts_of,
    worn,
    worn_log,
)
from fixtures.once import SHARED, fits_once
from fixtures.pages import blank, blank_figures, loads_nothing  # noqa: F401, fixtures of several packages
from fixtures.short_fit import fitted  # noqa: F401, a fixture of several packages

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent

# The same examples on every run, and nothing left on disk; an example may take long when the machine is busy.
settings.register_profile("clutchid", derandomize=True, database=None, deadline=None)
settings.load_profile("clutchid")

# Tests make much that is garbage at once and little that is so in circles: collecting that seldom saves a twelfth.
gc.set_threshold(100_000, 20, 20)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """All tests of a file in one worker, so that its fixtures (a site, a fleet, a calibration) are made once."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFixtures(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return next((folder for folder in TOGETHER if nodeid.startswith(folder)), nodeid.partition("::")[0])

    config.option.loadscopereorder = False  # the order of `pytest_collection_modifyitems`
    return ByFixtures(config, log)


#: A Python of another system, which no test may become.
collect_ignore = ["fixtures/another_system"]

#: Load of the synthetic recordings in N/m: all three weights are at work, theta_2 is negative as in Table 1.
THETA = (9.0e5, -0.3e5, 0.6e5)


#: Files that take longest, some with a test or two: they are first, so that no worker is left alone with one of them.
LONG = (
    "docs/test_site", "docs/test_console_blocks", "app/test_jobs", "house/test_python_page",
    "oracles/test_finite_differences", "golden/test_golden_results", "test_systems", "fleets/test_cluster",
    "cli/test_fleet_command", "documents/test_fit", "cli/test_track_command",
    "cli/test_fit_output", "study/test_paper_study", "cli/test_commands", "rig/test_lugre", "docs/test_gallery",
    "house/test_new_parameter",
)  # fmt: skip

#: Folders whose files share what takes long: a worker has all of one.
TOGETHER = ("tests/study/",)

#: Public names whose examples in the docstring take longer than 0.6 s.
SLOW_EXAMPLES = {"calibrate", "export", "fleet", "report", "track"}


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path) -> Any:
    """Look for examples in the docstrings of the package only, not in those of the tests."""
    nodes = yield
    return [node for node in nodes if not (isinstance(node, DoctestModule) and file_path.is_relative_to(HERE))]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark slow examples in docstrings, which cannot say so themselves, and put long files first.

    Examples give no work to other processes, leave figures empty, and share their fits.
    """
    long = tuple(f"tests/{file}.py" for file in LONG)
    items.sort(key=lambda item: not item.nodeid.startswith(long))
    for item in items:
        if isinstance(item, pytest.DoctestItem):
            for light in (blank_figures(), without_workers(), fits_once()):
                item.runtest = light(item.runtest)  # type: ignore[method-assign]
            if item.name.rpartition(".")[2] in SLOW_EXAMPLES:
                item.add_marker(pytest.mark.slow)
            if item.name.endswith(".export"):
                item.add_marker(pytest.mark.needs("cc"))


def pytest_collection_finish() -> None:
    """Tell the collector of garbage that the tests and what they import stay: it need not go through them again."""
    gc.collect()
    gc.freeze()


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kernels once, before workers start that would all do it; no test compiles for itself.

    The workers share the objects of C compilers and byte code too.

    A worker, and what it starts, has one thread: there is a worker for each processor, and a fit on two threads takes
    an eighth more of its time.

    With `--hypothesis-seed` the examples are others: a profile that has the same on every run would ignore it.
    """
    config.pluginmanager.register(programs)
    if config.getoption("--hypothesis-seed", None) is not None:
        settings.register_profile("seeded", settings.get_profile("clutchid"), derandomize=False)
        settings.load_profile("seeded")
    if hasattr(config, "workerinput"):
        return
    objects = tempfile.mkdtemp(prefix="clutchid-objects-")
    config.add_cleanup(lambda: shutil.rmtree(objects))
    compilers(Path(objects))
    os.environ["PATH"], os.environ[SHARED] = f"{objects}{os.pathsep}{os.environ['PATH']}", objects
    if config.getoption("numprocesses", None):
        for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"):
            os.environ.setdefault(name, "1")
        import_first("numba", "sympy")
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            parts = [pool.submit(compile_filter), pool.submit(clutchid.drive, 0, seconds=0.5)]
            parts += [pool.submit(compile_ahead, (variant,)) for variant in VARIANTS]
            import_first("scipy.stats", "matplotlib.pyplot")
            rewrite_asserts(config)
            for part in parts:
                part.result()


def import_first(*libraries: str) -> None:
    """Import libraries that have no byte code yet: processes that start together would each make it."""
    for name in libraries:
        origin = find_spec(name).origin  # type: ignore[union-attr]
        if not Path(cache_from_source(origin)).exists():  # type: ignore[arg-type]
            import_module(name)


def rewrite_asserts(config: pytest.Config) -> None:
    """Write the byte code of tests with their asserts, as pytest does on import: workers would each do so at once."""
    if sys.dont_write_bytecode or rewrite.assertstate_key not in config.stash:
        return
    compile_dir(ROOT / "src", quiet=1)
    for file in (*HERE.rglob("test_*.py"), *HERE.rglob("conftest.py")):
        stored = rewrite.get_cache_dir(file) / (file.stem + rewrite.PYC_TAIL)
        if rewrite._read_pyc(file, stored) is None and rewrite.try_makedirs(stored.parent):
            origin, code = rewrite._rewrite_test(file, config)
            rewrite._write_pyc(config.stash[rewrite.assertstate_key], code, origin, stored)


@pytest.fixture(scope="session", autouse=True)
def _signals_of_a_terminal() -> None:
    """Let Ctrl-C and a terminal that closes end what the tests start; `nohup` and background jobs ignore them."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    """Load the kernels of every variant from the user's cache once."""
    for variant in VARIANTS:
        kernels(variant)


@pytest.fixture(scope="session", autouse=True)
def _equations_once() -> Iterator[None]:
    """Print the equations of a model in C once."""
    with equations_once():
        yield


@pytest.fixture(scope="session")
def source() -> Path:
    """Folder of the package's source."""
    return ROOT / "src" / "clutchid"


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder with the paper and the recordings that lie beside the repository."""
    folder = ROOT.parent / "shared"
    if not (folder / "data" / "trucks").is_dir():
        pytest.skip(f"no {folder.name}/data/trucks beside the repository: the recordings of three trucks are needed.")
    return folder


@pytest.fixture(scope="session")
def data(shared: Path) -> Callable[[str], Path]:
    """Find a folder or file of shared/data by its path there."""

    def find(name: str) -> Path:
        if not (shared / "data" / name).exists():
            pytest.skip(f"no {shared.name}/data/{name} beside the repository: what is in it is needed.")
        return shared / "data" / name

    return find


@pytest.fixture(scope="session")
def truth() -> Actuator:
    """The actuator that made `drive`."""
    return Actuator(load=Load(THETA))


@pytest.fixture(scope="session")
def drive(truth: Actuator) -> Log:
    """10 s at 1 kHz in a closed position loop, noise-free: shifts over 15 mm, creeping around 6 mm, a staircase."""
    return closed_loop(truth, targets_of(10.0), "drive")


@pytest.fixture(scope="session")
def driven(truth: Actuator) -> Callable[..., Log]:
    """Make another recording: driven(reach=0.006) stays below 6 mm, driven(actuator=...) drives another truck."""

    def make(actuator: Actuator = truth, seconds: float = 10.0, reach: float = 0.015, name: str = "drive") -> Log:
        return closed_loop(actuator, targets_of(seconds) * (reach / 0.015), name)

    return make


@pytest.fixture(scope="session")
def with_noise() -> Callable[..., Log]:
    """Add white noise to position (m) and pressure (Pa) of a recording, from a seed."""

    def make(log: Log, seed: int, position: float = 5e-5, pressure: float = 2e3) -> Log:
        generator = np.random.default_rng(seed)
        noisy = {"position": position, "pressure_a": pressure}
        return log.with_columns(**{k: log[k] + s * generator.standard_normal(len(log)) for k, s in noisy.items()})

    return make


def targets_of(seconds: float) -> np.ndarray:
    """Wanted position in m for every millisecond."""
    t = np.arange(0, seconds, 1e-3)
    stairs = 1e-3 * np.array([0, 14, 14, 2, 6, 5, 7, 15, 11, 8, 4, 12, 3, 9, 0.5, 13, 10, 6.5, 1.5, 0.0])
    wanted = stairs[np.minimum((t / 0.5).astype(int) % stairs.size, stairs.size - 1)]
    creeping = (t > 2) & (t < 3.5)
    wanted[creeping] += 1e-3 * np.sin(2 * np.pi * 1.5 * t[creeping])
    wanted[t < 0.05] = 0.0
    return wanted


def closed_loop(actuator: Actuator, wanted: np.ndarray, name: str) -> Log:
    """Follow `wanted` with a proportional position controller on both valves, one kernel step a sample."""
    n, module, load = wanted.size, kernels(actuator.model), actuator.load
    p, breakpoints, table = actuator.parameters.array(), load.breakpoints, load.combined()
    q = actuator.parameters
    vented = {"p_A": q.P_0, "p_B": q.P_0, "T_A": q.T_w, "T_B": q.T_w, "p_S": q.P_S, "p_G": q.P_S}
    x = np.array([vented.get(state, 0.0) for state in VARIANTS[actuator.model]])
    dt, substep = np.array([1e-3]), np.ones(1, dtype=np.int32)
    never, nothing, two = np.zeros(2, dtype=np.uint8), np.zeros((2, 2)), np.empty((2, x.size))
    inputs, states = np.zeros((n, len(system(actuator.model).inputs))), np.empty((n, x.size))
    for k in range(n):
        states[k] = x
        error = wanted[k] - x[0]
        duty = min(1.0, 0.05 + 150 * (abs(error) - 1e-4)) if abs(error) > 1e-4 else 0.0
        inputs[k, 0 if error > 0 else 1] = duty if wanted[k] > 0 or error < 0 else 0.0
        module.run(x, np.array([inputs[k], inputs[k]]), p, dt, substep, never, nothing, breakpoints, table, two)
    columns = {"position": states[:, 0], "duty_supply": inputs[:, 0], "duty_exhaust": inputs[:, 1]}
    return Log(np.arange(n) * 1e-3, {**columns, "pressure_a": states[:, 2]}, name)
