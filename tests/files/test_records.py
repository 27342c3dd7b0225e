"""Records as tables of a TOML file: what is written is read, and whatever people give is one sentence, at once."""

import time
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import pytest
import tomli_w

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.parameter_file import read_parameters
from clutchid.files.records import Rule, collected, covariance_problem, plain, read_record, read_toml, table
from clutchid.log import FloatArray
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_records")


class Span(NamedTuple):
    low: float
    high: float = float("nan")


@dataclass(frozen=True)
class Sensor:
    name: str
    kind: Literal["rod", "line_sensor"]
    spans: Mapping[str, Span]
    samples: int = 0
    used: bool = True
    pairs: tuple[tuple[float, float], ...] = ()
    root: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    rest: Span | None = None


FULL = Sensor(
    "s", "rod", {"a": Span(1.0, 2.0)}, 3, False, ((1.0, 2.0),), np.array([[1.0, 0.1], [0.0, 1e-300]]), Span(3.0)
)
PLAIN = {"name": "s", "kind": "rod", "spans": {}}


def test_a_record_in_a_file_is_read_bit_by_bit():
    again = read_record(Sensor, tomllib.loads(tomli_w.dumps(table(FULL))), "[sensor]")
    np.testing.assert_array_equal(again.root, FULL.root)
    assert again.root.dtype == np.float64
    assert repr(again) == repr(FULL)


def test_what_is_nothing_by_default_is_left_out_and_read_as_nothing():
    bare = Sensor("", "rod", {})
    assert table(bare) == {"name": "", "kind": "rod", "spans": {}, "samples": 0, "used": True}
    assert repr(read_record(Sensor, table(bare), "[sensor]")) == repr(bare)


def test_chosen_fields_are_written_in_the_order_of_the_choice():
    assert list(table(FULL, ("samples", "rest", "name"))) == ["samples", "rest", "name"]


def test_numbers_and_arrays_of_numpy_become_those_of_toml():
    of_numpy = {"a": np.float64(0.1), "b": np.arange(2), "c": (np.int64(3), "x")}
    assert plain(of_numpy) == {"a": 0.1, "b": [0, 1], "c": [3, "x"]}


def test_a_record_may_stand_as_the_list_of_its_fields():
    assert read_record(Sensor, {**PLAIN, "spans": {"a": [1, 2]}}, "[sensor]").spans == {"a": Span(1.0, 2.0)}


@pytest.mark.parametrize(("entries", "sentence"), CASES["entries"])
def test_a_wrong_entry_is_one_sentence_with_its_place(entries, sentence):
    with pytest.raises(ParameterError) as caught:
        read_record(Sensor, {**PLAIN, **entries}, "[sensor]")
    assert str(caught.value).startswith(sentence)
    assert len(str(caught.value).splitlines()) == 1


def test_all_problems_of_a_record_are_listed():
    problems: list[str] = []
    assert collected(problems, read_record, Sensor, {"name": 5, "spans": {"a": {}}, "x": 1}, "[sensor]") is None
    assert [problem.partition(":")[0] for problem in problems] == [
        "no entry of [sensor] 'x'. Known are name, kind, spans, samples, used, pairs, root, rest.",
        "[sensor] name = 5",
        "[sensor] kind",
        "[sensor.spans.a] low",
    ]


RULES = {"rest": Rule("a level above 0 is needed", lambda span: span.low > 0.0), "samples": Rule("count again")}


@pytest.mark.parametrize(("entries", "sentence"), CASES["rules"])
def test_a_rule_speaks_for_an_entry_and_for_all_in_a_section(entries, sentence):
    with pytest.raises(ParameterError) as caught:
        read_record(Sensor, {**PLAIN, **entries}, "[sensor]", RULES)
    assert str(caught.value) == sentence


STRANGE = {
    "an integer beyond floats": (f"[parameters]\nM = 1{'0' * 400}\n", r"M = 10+…: a number in kg is needed"),
    "an integer of 5001 digits": (f"[parameters]\nM = 1{'0' * 5000}\n", "a number has too many digits"),
    "lists in lists": (f"[parameters]\nM = {'[' * 5000}{']' * 5000}\n", "nested too deeply"),
    "too many knots": (
        f"[model]\nload_basis = 'b-spline'\nknots = [{', '.join(f'{i}e-6' for i in range(20_000))}]\n",
        "20,000 positions; at most 500 are allowed",
    ),
    "a letter too small": ("[parameters]\nF_c = 1.0\n", "no parameter 'F_c'; did you mean 'F_C'"),
    "no TOML": ("M: 1\n", r"is not a TOML file \("),
    "bytes of another encoding": ("[model]\n# \udcfc\n", r"is not a TOML file \("),
}


@pytest.mark.parametrize("name", STRANGE)
def test_strange_content_is_one_sentence(name, tmp_path):
    text, sentence = STRANGE[name]
    path = tmp_path / "fit.toml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ParameterError, match=rf"fit\.toml: .*{sentence}"):
        read_parameters(path)


def test_of_many_unknown_names_the_first_few_are_listed_in_a_second(tmp_path):
    path = tmp_path / "fit.toml"
    path.write_text("[parameters]\n" + "".join(f"k{i} = 1\n" for i in range(50_000)))
    begun = time.process_time()
    with pytest.raises(ParameterError, match=r"(?s)no parameter 'k0'.*'k4'.*and 49,995 more") as caught:
        read_parameters(path)
    assert time.process_time() - begun < 2.0
    assert str(caught.value).count("Known are") == 1


def test_a_file_that_is_too_large_for_what_it_should_be_is_not_parsed(tmp_path):
    path = tmp_path / "fit.toml"
    path.write_text("[parameters]\n" + "# nothing\n" * 500_000)
    with pytest.raises(DataError, match="has more than 4 MB"):
        read_parameters(path)


def test_a_byte_order_mark_is_no_part_of_the_file(tmp_path):
    path = tmp_path / "fit.toml"
    path.write_bytes(b"\xef\xbb\xbf[parameters]\nM = 12.5\n")
    assert read_toml(path, "parameter file") == {"parameters": {"M": 12.5}}


@pytest.mark.parametrize(("below", "problem"), [(0.5, ""), (0.4, "is not symmetric")])
def test_a_covariance_is_looked_at_in_the_units_of_its_standard_deviations(below, problem):
    units = np.diag([1.0, 1e-6])
    assert covariance_problem(units @ [[1.0, 0.5], [below, 1.0]] @ units, ["a", "b"], [3.0, 3.0]) == problem
