"""The API reference: each public name has an example, its arguments, and each field of a result a description."""

import inspect
import re
import sys
from pathlib import Path

import pytest

import clutchid

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def pages():
    """The module that makes the pages of the reference."""
    sys.path.insert(0, str(DOCS))
    try:
        import api_pages

        yield api_pages
    finally:
        sys.path.remove(str(DOCS))


def docstring(name):
    return inspect.getdoc(getattr(clutchid, name)) or ""


def section(text, heading):
    match = re.search(rf"^{heading}\n-+\n(.*?)(?=\n\n\S[^\n]*\n---|\Z)", text, re.MULTILINE | re.DOTALL)
    return match[1] if match else ""


FUNCTIONS = [name for name in clutchid.__all__ if inspect.isfunction(getattr(clutchid, name))]


def test_every_public_name_has_an_example_that_the_tests_run():
    assert [name for name in clutchid.__all__ if ">>> " not in section(docstring(name), "Examples")] == []


def test_every_argument_of_a_public_function_is_described():
    lacking = {}
    for name in FUNCTIONS:
        entries = re.findall(r"^(\S[^\n:]*?)(?: : .*)?$", section(docstring(name), "Parameters"), re.MULTILINE)
        described = {argument.strip() for entry in entries for argument in entry.split(",")}
        lacking[name] = set(inspect.signature(getattr(clutchid, name)).parameters) - described
    assert {name: sorted(names) for name, names in lacking.items() if names} == {}


def test_every_public_function_says_what_it_returns():
    returns = {name: inspect.signature(getattr(clutchid, name)).return_annotation for name in FUNCTIONS}
    silent = [
        name for name, kind in returns.items() if kind not in {"None", None} and "Returns\n---" not in docstring(name)
    ]
    assert silent == []


def test_every_field_of_every_public_result_is_described(pages):
    records = [record for record in pages.records() if record is not clutchid.Parameters]
    assert len(records) > 50
    lacking = {record.__name__: sorted({*pages.fields_of(record)} - pages.described(record)) for record in records}
    assert {name: fields for name, fields in lacking.items() if fields} == {}


def test_no_description_is_of_a_field_that_does_not_exist(pages):
    records = [record for record in pages.records() if record is not clutchid.Parameters]
    extra = {record.__name__: sorted(pages.described(record) - {*pages.fields_of(record)}) for record in records}
    assert {name: fields for name, fields in extra.items() if fields} == {}


def test_every_row_of_the_parameters_has_unit_meaning_and_source():
    rows = clutchid.Parameters.rows()
    assert len(rows) > 60
    assert [name for name, row in rows.items() if not (row.unit and row.meaning and row.source)] == []


def test_no_two_pages_of_the_reference_are_one_file_where_case_does_not_count(pages):
    names = [name.lower() for name in pages.api_pages("")]
    assert sorted(set(names)) == sorted(names)
    assert {pages.page_name(name) for name in clutchid.__all__} <= {
        name.rpartition(".")[0] for name in pages.api_pages("")
    }
