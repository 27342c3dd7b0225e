"""The comparison with other packages: each peer solves the equations, and the page has a row for all of them."""

import math
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

PEERS = Path(__file__).resolve().parents[2] / "benchmarks" / "peers"


@pytest.fixture
def peers(monkeypatch):
    """Modules of benchmarks/peers by name; they import each other as the command does."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(PEERS.parent))
    monkeypatch.syspath_prepend(str(PEERS))
    yield import_module
    for name in set(sys.modules) - before:
        if str(PEERS.parent) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def test_clutchid_and_scipy_agree_with_the_reference_on_a_short_recording(peers):
    problem, simulation = peers("problem").Problem(0.2), peers("simulation")
    # steps of 1 ms through an impact on an end stop, and a tolerance of 1e-6: see docs/benchmarks.md for the first
    bounds = {"clutchid, compiled loop": 30e-6, "clutchid.simulate": 30e-6, "SciPy, LSODA": 1e-6}
    chosen = [peer for peer in simulation.PEERS if peer.name in bounds]
    assert len(chosen) == 3
    for peer in chosen:
        assert simulation.largest_error(problem, peer.prepare(problem)().value) < bounds[peer.name]


def test_the_page_names_a_peer_that_is_not_installed_as_absent(peers):
    run, simulation, peer = peers("run"), peers("simulation"), peers("peer")
    chosen = (*simulation.PEERS[:2], peer.Peer("none", ("no_such_package",), simulation.kernel))
    rows = simulation.rows([(0.1, 1000.0)], chosen, rounds=1)
    page = run.page({"a": run.PartResult("command", {"Python": "3"}, rows, [])})
    assert "absent: no_such_package not installed" in page
    assert "| clutchid, compiled loop |" in page


def test_the_model_without_branches_has_the_rates_of_the_model(peers):
    problem, plain, equations = peers("problem").Problem(0.1), peers("plain"), peers("equations")
    expected = plain.scalar_rates(equations.python_text(problem.values))
    choose = plain.Operations(math.sqrt, max, lambda condition, yes, no: yes if condition else no)
    rates_of_change, random = problem.model.rates(choose), np.random.default_rng(0)
    low, high = [-1e-3, -0.3, 1.0e5, 0.8e5, -2e-4], [26e-3, 0.3, 9.1e5, 1.3e5, 2e-4]
    for _ in range(200):
        x, u = random.uniform(low, high).tolist(), random.uniform(0.0, 1.0, 2).tolist()
        assert rates_of_change(x, u, []) == pytest.approx(expected(*x, *u, problem.table), rel=1e-12)


def test_the_exported_c_follows_as_the_observer_does_and_the_page_has_its_slowest_steps(peers):
    run, observers, peer = peers("run"), peers("observers"), peers("peer")
    chosen = (observers.IN_PYTHON[2], observers.IN_C[0], peer.Peer("none", ("no_such_package",), observers.whole))
    rows = observers.compared("2 s", peers("ekf").Followed(2.0), chosen, rounds=1, budget=1.0)
    page = run.page({"e": run.PartResult("command", {"Python": "3"}, rows, [])})
    assert "| p99 | p99.9 |" in page
    assert "absent: no_such_package not installed" in page
    assert not rows[1].note.startswith("failed")
    assert rows[0].error == rows[1].error
