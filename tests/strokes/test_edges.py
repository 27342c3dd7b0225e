"""Edges of duty cycles between the samples go with the parts of a recording."""

import numpy as np
import pytest

import clutchid
from clutchid.log import INPUTS, Log
from clutchid.measurements import read, write
from clutchid.strokes import joined, sections_of


@pytest.fixture(scope="module")
def log():
    """The bundled recording whose duty cycles have edges 0.3 ms after the samples at which they change."""
    bundled = clutchid.bundled_recording()
    changes = {name: np.flatnonzero(np.diff(bundled[name], prepend=np.nan)) for name in INPUTS}
    edges = {name: (bundled.time[at] + 3e-4, bundled[name][at]) for name, at in changes.items()}
    return Log(bundled.time, bundled.columns, "bundled", edges=edges)


def test_sections_keep_the_edges_between_their_samples(log):
    sections = list(sections_of(log))
    assert len(sections) > 3
    for section in sections:
        part = section.log
        for name in INPUTS:
            stamps, values = part.edges[name]
            whole, held = log.edges[name]
            inside = (whole >= part.time[0]) & (whole < part.time[-1])
            own = (stamps > part.time[0]) & (stamps < part.time[-1])
            assert np.array_equal(stamps[own], whole[inside & (whole > part.time[0])])
            assert np.array_equal(values[own], held[inside & (whole > part.time[0])])


def test_sections_do_not_depend_on_the_pieces_that_arrive(log):
    pieces = [log.slice(start, min(start + 777, len(log))) for start in range(0, len(log), 777)]
    for first, other in zip(sections_of(log), sections_of(pieces), strict=True):
        assert first.log.edges.keys() == other.log.edges.keys()
        for name, edges in first.log.edges.items():
            assert all(np.array_equal(a, b) for a, b in zip(edges, other.log.edges[name], strict=True))


def test_joined_sections_simulate_as_the_recording_they_were_cut_from(log, tmp_path):
    actuator = clutchid.Actuator()
    sections = list(sections_of(log))
    together = joined(sections)
    write(together, tmp_path / "together.parquet")
    again = read(tmp_path / "together.parquet")
    assert {name: stamps.size for name, (stamps, _) in again.edges.items()} == {
        name: stamps.size for name, (stamps, _) in together.edges.items()
    }
    direct = clutchid.simulate(actuator, log.slice(0, len(sections[0].log))).log["position"]
    assert clutchid.simulate(actuator, sections[0].log).log["position"][:-1] == pytest.approx(direct[:-1], abs=1e-12)
