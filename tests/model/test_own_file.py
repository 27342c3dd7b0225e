"""Models of one's own from a file: read, and one clear sentence where that cannot be."""

import pytest

from clutchid.errors import ParameterError
from clutchid.model import own_model
from clutchid.model.own.file import model_named
from fixtures.sentences import one_sentence

SPRING = """
from sympy import symbols
from clutchid.model import OwnModel, OwnParameter

y, f_s, c_r = symbols("y f_s c_r")
STIFFNESS = OwnParameter(4e3, "N/m", "stiffness of the return spring", range=(0, 1e5))
spring = OwnModel("isothermal", parameters={"c_r": STIFFNESS}, terms={"f_s": f_s + c_r * y})
"""


@pytest.fixture
def file(tmp_path):
    """Write a file with a text."""

    def write(text=SPRING):
        path = tmp_path / "spring.py"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_model_has_its_name_and_file(file):
    model = own_model(file(), "spring")
    assert (model.name, model.file, str(model)) == ("spring", "spring.py", "spring.py:spring")
    assert model_named(f"{file()}:spring") == model


def test_reading_a_model_leaves_no_file_behind(file):
    path = file()
    own_model(path, "spring")
    assert [other.name for other in path.parent.iterdir()] == ["spring.py"]


def test_comments_and_layout_are_not_part_of_the_meaning(file):
    before = own_model(file(), "spring").sha256
    assert own_model(file("# a remark\n" + SPRING.replace("c_r * y", "y  *  c_r")), "spring").sha256 == before
    assert own_model(file(SPRING.replace("4e3", "4000").replace("the return", "a")), "spring").sha256 == before
    assert own_model(file(SPRING.replace("4e3", "5e3")), "spring").sha256 != before


@pytest.mark.parametrize(
    ("text", "name", "sentence"),
    [
        (SPRING, "sprung", "there is no 'sprung'; models in it are spring."),
        (SPRING, "STIFFNESS", "STIFFNESS is not an OwnModel but OwnParameter; models in it are spring."),
        ("x = 1\n", "spring", "there is no 'spring'; it has no OwnModel; see docs/own_models.md."),
    ],
)
def test_a_name_that_is_no_model_is_refused_with_the_names_that_are(file, text, name, sentence):
    with pytest.raises(ParameterError) as caught:
        own_model(path := file(text), name)
    assert str(caught.value) == f"{path}: {sentence}"


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        ("import sympy\n1 / 0\n", 2, "the file cannot be executed (ZeroDivisionError: division by zero)."),
        ("import sympy\n\nx = = 2\n", 3, "the file cannot be executed (SyntaxError: invalid syntax)."),
        ("import no_such_library\n", 1, "the file cannot be executed (ModuleNotFoundError: No module named"),
        ("raise SystemExit(3)\n", 1, "the file cannot be executed (SystemExit: 3)."),
        (SPRING.replace("f_s + c_r * y", "f_s + c_R * y"), 7, "the file cannot be executed (NameError: name 'c_R' is"),
        (SPRING.replace("f_s + c_r * y", "f_s + c_r"), 7, "terms: f_s: the units do not fit: c_r + f_s_base combines"),
    ],
)
def test_a_file_that_raises_is_named_with_its_line(file, text, line, sentence):
    path = file(text)
    message = one_sentence(ParameterError, own_model, path, "spring")
    assert message.startswith(f"{path}, line {line}: {sentence}")


def test_an_option_that_names_no_model_says_what_is_known(tmp_path):
    with pytest.raises(ParameterError, match=r"there is no such file; a model is named FILE\.py:NAME"):
        model_named(f"{tmp_path}/none.py:spring")
    with pytest.raises(ParameterError, match=r"which model of the file\? Write spring\.py:NAME"):
        model_named("spring.py")
    with pytest.raises(ParameterError, match=r"did you mean 'isothermal'.*A model of your own is named FILE\.py:NAME"):
        model_named("isotherm")
