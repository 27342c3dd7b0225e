"""The comparison with other packages: each peer solves the equations, and the page has a row for all of them."""

import sys
from importlib import import_module
from pathlib import Path

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
    chosen = [each for each in simulation.PEERS if each.name in bounds]
    assert len(chosen) == 3
    for each in chosen:
        assert simulation.largest_error(problem, each.prepare(problem)().value) < bounds[each.name]


def test_the_page_names_a_peer_that_is_not_installed_as_absent(peers):
    run, simulation, peer = peers("run"), peers("simulation"), peers("peer")
    chosen = (*simulation.PEERS[:2], peer.Peer("none", ("no_such_package",), simulation.kernel))
    rows = simulation.rows([(0.1, 1000.0)], chosen, rounds=1)
    page = run.page({"a": run.Found("command", {"Python": "3"}, rows, [])})
    assert "absent: no_such_package not installed" in page
    assert "| clutchid, compiled loop |" in page
