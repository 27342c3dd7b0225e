"""One shape of the verbs of a fit, one record of their options, and its one text form."""

from __future__ import annotations

import inspect
from dataclasses import fields
from pathlib import Path

import pytest

import clutchid
from clutchid import FitRequest
from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.simulation.partition import Partition
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.options import USUAL, ReadingText, RequestText, requested
from clutchid.verbs.reading import Reading

EVERYDAY = ("free", "measure", "bounds", "method", "zero")
OF_FILES = ("ambient", "channels", "dbc", "force")

#: Fields of a request that come from a parameter file, and the options from which the others come.
FROM_FILES = {"calibration", "continues", "rest"}
OPTIONS = {"priors": {"prior"}, "partition": {"every", "parts", "carry", "take"}}


def test_the_verbs_of_a_fit_have_one_shape():
    shapes = [[*inspect.signature(getattr(clutchid, verb)).parameters] for verb in USUAL]
    assert shapes[0] == shapes[1]
    assert [name for name in shapes[0] if name != "actuator"] == [name for name in shapes[2] if name != "start"]
    assert shapes[0][3:8] == [*EVERYDAY]
    assert set(OF_FILES) <= set(shapes[0]) & {field.name for field in fields(Reading)}
    assert set(EVERYDAY) <= {field.name for field in fields(FitRequest)}


def test_the_text_form_has_every_option_of_the_record():
    names = {field.name for field in fields(FitRequest)} - FROM_FILES
    options = set().union(*(OPTIONS.get(name, {name}) for name in names))
    assert {field.name for field in fields(RequestText)} == options | {"model"}


def test_a_request_is_that_of_its_text():
    text = RequestText(
        free="load, P_S", bounds=["P_S=8e5:"], prior=["P_S=9e5+-1e4"], every=200, carry="q", bootstrap=20,
        profile="P_S", method="shooting", zero="keep",
    )  # fmt: skip
    assert text.request("calibrate") == FitRequest(
        ("position", "pressure_a"), ("load", "P_S"), {"P_S": (8e5, float("inf"))}, Partition(every=200, carry="q"),
        "shooting", {"P_S": Prior(9e5, 1e4)}, profile=("P_S",), bootstrap=20, zero="keep",
    )  # fmt: skip


@pytest.mark.parametrize("verb", USUAL)
def test_a_request_that_names_no_columns_and_parameters_has_those_of_the_verb(verb):
    request = requested(verb, FitRequest(bootstrap=20))
    assert (request.measure, request.free, request.bootstrap) == (*USUAL[verb], 20)
    assert requested(verb, None, free="P_S, M").free == ("P_S", "M")
    assert requested(verb, FitRequest(free=()), zero="keep").free == ()


def test_an_option_beside_a_request_that_says_otherwise_is_an_error():
    request = FitRequest(free=("load",), method="shooting")
    assert (
        requested("fit", request, free="load", method="shooting", bounds={"theta_1": (0.0, 2e6)}).method == "shooting"
    )
    with pytest.raises(ParameterError, match=r"method = 'simulation': the request has method = 'shooting'"):
        requested("fit", request, method="simulation")


def test_a_command_is_spelled_from_its_options_and_reads_the_same(tmp_path):
    asked = FitCommand(
        verb="fit", logs=(Path("-a.csv"), Path("b.csv")), start=Path("CAL.toml"),
        search=RequestText(free="load,P_S", bounds=["P_S=8e5:9e5", "theta_1=0:"]), verify=(Path("c.csv"),),
        files=ReadingText(ambient="1.01bar", map=Path("m.toml"), dbc=[Path("x.dbc"), Path("y.dbc")]), force=True,
        save=(Path("out.toml"), Path("out.mat")), report=Path("page.html"),
    )  # fmt: skip
    assert " ".join(asked.words) == (
        "fit ./-a.csv b.csv --start CAL.toml --free load,P_S --bounds P_S=8e5:9e5 theta_1=0: --ambient 1.01bar "
        "--map m.toml --dbc x.dbc y.dbc --force --verify c.csv --save out.toml --save out.mat --report page.html"
    )
    assert asked.python.splitlines()[2] == (
        "fit = clutchid.estimate(['-a.csv', 'b.csv'], 'CAL.toml', free='load,P_S', "
        "bounds={'P_S': (800000.0, 900000.0), 'theta_1': (0.0, float('inf'))}, verify=['c.csv'], force=True, "
        "ambient=101000.0, channels='m.toml', "
        "dbc=['x.dbc', 'y.dbc'])"
    )


def test_the_python_of_a_command_has_every_option_of_its_request(monkeypatch):
    search = RequestText(
        measure="position,pressure_a", free="load,C_vs", bounds=["C_vs=1e-8:"], every=200, carry="q", method="shooting",
        prior=["P_S=8.5e5±5e3"], profile="C_vs", bootstrap=20, zero="keep",
    )  # fmt: skip
    call = FitCommand(verb="fit", logs=(Path("a.csv"),), search=search).python.splitlines()[2].partition(" = ")[2]
    monkeypatch.setattr(clutchid, "fit", lambda log, request, **everyday: requested("fit", request, **everyday))
    repeated = eval(call)
    assert repeated == search.request("fit")
