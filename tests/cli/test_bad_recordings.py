"""What `look` calls bad, `simulate` refuses as well, unless it is forced; the other verbs are in tests/doors."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.measurements import write
from clutchid.model import Actuator
from clutchid.truck import drive, truck
from clutchid.verbs.reading import reading_of
from fixtures.commands import called


@pytest.fixture(scope="module")
def sound():
    return drive(truck(3), seconds=6.0, seed=2, name="run").log


def test_simulate_refuses_it_as_well(sound, tmp_path, capsys):
    log, start, out = (tmp_path / name for name in ("run.parquet", "p.toml", "s.csv"))
    swapped = {"duty_supply": sound["duty_exhaust"], "duty_exhaust": sound["duty_supply"]}
    write(sound.with_columns(**swapped), log)
    write_parameters(ParameterFile(Actuator()), start)
    for extra, code in (([], 2), (["--force"], 0)):
        assert called("simulate", log, "--parameters", start, "--out", out, *extra) == code
        assert out.exists() == (code == 0)
    answer = capsys.readouterr()
    assert "duty cycles are swapped" in answer.err
    assert "simulated run: position " in answer.out


def test_force_fits_it_with_the_sentence_as_a_warning(sound):
    bad = sound.with_columns(pressure_a=np.full(len(sound), 2e5))
    with pytest.raises(DataError, match="in every sample"):
        reading_of([sound, bad]).checked(Actuator())
    first, second = reading_of([sound, bad], force=True).checked(Actuator())
    assert not first.warnings
    assert any("in every sample" in warning for warning in second.warnings)


def test_a_recording_of_a_few_samples_is_refused(sound):
    for count in (1, 50, 150):
        with pytest.raises(DataError, match="less than a stroke, so nothing can be fitted"):
            reading_of(sound.slice(0, count)).checked(Actuator())
