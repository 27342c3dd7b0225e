"""Bad input of every command: one sentence, exit code 2, and no file written or changed."""

import shlex

import pytest

from clutchid.measurements import read, write
from fixtures.cases import case_tables
from fixtures.changed_logs import thinned

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def inputs(folder, tmp_path_factory):
    """A folder with what the commands name."""
    made = tmp_path_factory.mktemp("inputs")
    write(read(folder / "worn.parquet").without("pressure_a"), made / "LOG.csv")
    write(thinned(read(folder / "worn.parquet"), 20), made / "slow.parquet")
    (made / "cal.toml").write_bytes((folder / "cal.toml").read_bytes())
    (made / "two.csv").write_text("recording,vehicle\nLOG,V1\nslow,V2\n")
    (made / "none.csv").write_text("recording,vehicle\nother,V1\n")
    return made


@pytest.mark.parametrize(
    ("line", "words"), [(line, words) for line, *words in case_tables(__file__, "refusals")["commands"]]
)
def test_bad_input_is_one_sentence_and_exit_code_two(command, inputs, line, words):
    before = {path.name: path.read_bytes() for path in inputs.iterdir()}
    arguments = [word.replace("NAME", inputs.name) for word in shlex.split(line)]
    process = command(*("LOG.csv" if word == "LOG" else word for word in arguments), cwd=inputs)
    said = " ".join(process.stderr.split())
    assert process.returncode == 2, said
    assert "Traceback" not in said
    assert [word for word in words if word not in said] == []
    assert {path.name: path.read_bytes() for path in inputs.iterdir()} == before
