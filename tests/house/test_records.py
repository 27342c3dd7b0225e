"""Every public record can be pickled and copied, also to a process that has only just begun."""

import copy
import dataclasses
import multiprocessing
import pickle
import subprocess
import sys
import types
import typing
from collections import abc
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from sympy import Symbol

import clutchid
from clutchid import Actuator, Partition
from clutchid.model.own import OwnModel, OwnParameter
from clutchid.observer.configuration import observer, start
from clutchid.truck import truck
from fixtures.public_records import annotations, is_record, public_records, records_of

WAYS = {"pickle": lambda value: pickle.loads(pickle.dumps(value)), "deepcopy": copy.deepcopy, "copy": copy.copy}


@pytest.fixture(scope="module")
def log():
    """4 s of the bundled recording."""
    return clutchid.bundled_recording().slice(0, 4000)


@pytest.fixture(scope="module")
def examples(log):
    """What the functions of clutchid return, and records that hold more than their annotations say."""
    fit = clutchid.fit(log, verify=log)
    c = OwnParameter(1.0, "N/m", "c", range=(0, 2))
    fan = OwnModel("isothermal", parameters={"c": c}, terms={"f_s": Symbol("f_s") + Symbol("c") * Symbol("y")})
    return [
        log, fit, clutchid.simulate(Actuator(), log, sensitivities="P_S"), clutchid.verdict(fit),
        clutchid.simulate_many(Actuator(), log.slice(0, 400)),
        clutchid.parameter_file(fit), clutchid.drive(truck(0), seconds=0.5), Actuator(model=fan), Partition(parts=2),
        start(observer(Actuator())), observer(Actuator()), observer(Actuator(), "states"),
        truck(3, "B"), clutchid.FitRequest(bounds={"P_S": (8e5, 9e5)}, priors={"P_S": clutchid.Prior(9e5, 1e4)}),
    ]  # fmt: skip


#: A value of a simple kind.
SIMPLE = {
    float: 1.5, int: 2, bool: True, str: "text", bytes: b"x", np.ndarray: np.arange(3.0), Path: Path("a"),
    type(None): None, datetime: datetime(2026, 5, 1, tzinfo=UTC), type: Partition,
    abc.Callable: len, object: 1.0, typing.Any: 1.0,
}  # fmt: skip


def made(hint, records_made):
    """A value of an annotated kind: a record that has been made, or of its fields; containers have one entry."""
    origin, arguments = typing.get_origin(hint) or hint, typing.get_args(hint)
    if hint in records_made or origin in SIMPLE:
        return records_made[hint] if hint in records_made else SIMPLE[origin]
    if origin is typing.Literal:
        return arguments[0]
    if origin in (typing.Union, types.UnionType):
        return made(arguments[0], records_made)
    if origin is tuple:
        return tuple(made(argument, records_made) for argument in arguments if argument is not Ellipsis)
    if origin is frozenset:
        return frozenset({made(arguments[0], records_made)})
    if origin in (abc.Sequence, abc.Collection, abc.Iterable, list):
        return [made(arguments[0], records_made)]
    if origin in (abc.Mapping, dict):
        return {made(arguments[0], records_made): made(arguments[1], records_made)}
    if is_record(hint):
        records_made[hint] = hint(**{name: made(kind, records_made) for name, kind in _fields(hint).items()})
        return records_made[hint]
    raise NotImplementedError(hint)


def _fields(kind):
    return {
        name: annotation
        for name, annotation in annotations(kind).items()
        if typing.get_origin(annotation) is not typing.ClassVar
    }


def same(first, other):
    """Whether two values have the same kinds and the same content."""
    if type(first) is not type(other):
        return False
    if is_record(type(first)):
        names = getattr(first, "_fields", None) or [item.name for item in dataclasses.fields(first)]
        return all(same(getattr(first, name), getattr(other, name)) for name in names)
    if isinstance(first, abc.Mapping):
        return [*first] == [*other] and all(same(first[key], other[key]) for key in first)
    if isinstance(first, tuple | list):
        return len(first) == len(other) and all(map(same, first, other))
    if isinstance(first, np.record):
        return same(first.item(), other.item())
    if isinstance(first, np.ndarray | float):
        return np.array_equal(first, other, equal_nan=True)
    return type(first).__eq__ is object.__eq__ or bool(first == other)


@pytest.mark.slow
def test_every_public_record_can_be_pickled_and_copied(examples):
    """Those of the annotations of ``clutchid.__all__`` and in their fields; one of a new kind is made by them."""
    records = [record for example in examples for record in records_of(example)]
    record_of = {kind: record for record in records for kind in type(record).__mro__ if is_record(kind)}
    missing = []
    for kind in public_records() - set(record_of):
        try:
            made(kind, record_of)
        except (NotImplementedError, clutchid.ClutchidError, ValueError, TypeError, AttributeError) as error:
            missing.append(f"{kind.__name__}: {type(error).__name__} {error}")
    assert missing == [], "an example of each of these is needed above"
    for value in record_of.values():
        for name, way in WAYS.items():
            assert same(value, way(value)), (name, type(value))


@pytest.mark.parametrize("name", WAYS)
def test_a_copy_of_a_log_is_read_only_as_the_log_is(log, name):
    other = WAYS[name](dataclasses.replace(log, edges={"duty_supply": (np.arange(3.0), np.zeros(3))}))
    for values in (other.time, other["position"], *other.edges["duty_supply"]):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0
    for mapping in (other.columns, other.metadata, other.edges):
        with pytest.raises(TypeError, match="item assignment"):
            mapping["a"] = 1
    assert other.metadata == log.metadata


def test_errors_can_be_pickled():
    kinds = [getattr(clutchid, name) for name in clutchid.__all__ if name.endswith(("Error", "Extra"))]
    for kind in kinds:
        error = pickle.loads(pickle.dumps(kind("its sentence.")))
        assert (type(error), str(error)) == (kind, "its sentence.")


@pytest.mark.slow
def test_records_pass_through_a_pool_of_new_processes_and_a_new_process_has_all_of_them(log, tmp_path):
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        fit = pool.submit(clutchid.fit, log, progress=None).result()
        simulation = pool.submit(clutchid.simulate, fit.actuator, log).result()
    assert simulation.log.name == log.name
    assert fit.verdict.trust
    (tmp_path / "fit.pickle").write_bytes(pickle.dumps([fit, simulation, log]))
    shown = (
        "import pickle, sys; fit, simulation, log = pickle.load(open(sys.argv[1], 'rb')); print(fit.verdict.trust); "
    )
    shown += "log.plot; simulation.plot"
    process = subprocess.run(
        [sys.executable, "-c", shown, tmp_path / "fit.pickle"], capture_output=True, text=True, check=False
    )
    assert (process.stdout.strip(), process.stderr) == (fit.verdict.trust, "")
