"""TOML files that people give: whatever is in them, the answer is the file's content or one sentence, at once."""

import os
import sys
import time

import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.parameter_file import read_parameters
from clutchid.recordings.records import read_toml

STRANGE = {
    "an integer beyond floats": (f"[parameters]\nM = 1{'0' * 400}\n", r"M = 10+…: a number in kg is needed"),
    "an integer of 5001 digits": (f"[parameters]\nM = 1{'0' * 5000}\n", "a number has too many digits"),
    "lists in lists": (f"[parameters]\nM = {'[' * 5000}{']' * 5000}\n", "nested too deeply"),
    "too many knots": (
        f"[model]\nload_basis = 'b-spline'\nknots = [{', '.join(f'{i}e-6' for i in range(20_000))}]\n",
        "20,000 positions; at most 500 are allowed",
    ),
    "a letter too small": ("[parameters]\nF_c = 1.0\n", "no parameter 'F_c'; did you mean 'F_C'"),
    "no TOML": ("M: 1\n", r"is no TOML file \("),
    "bytes of another encoding": ("[model]\n# \udcfc\n", r"is no TOML file \("),
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


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no named pipes in folders")
def test_a_pipe_or_a_device_is_refused_before_it_is_read(tmp_path):
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    for path in (pipe, "/dev/zero"):
        with pytest.raises(DataError, match="is not a plain file; save the parameter file to a file first"):
            read_parameters(path)
