"""What `look` calls bad, `fit` and `simulate` refuse with the same sentence, unless they are forced."""

from dataclasses import replace

import pytest

from clutchid.errors import DataError
from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.measurements import read, write
from clutchid.model import Actuator
from clutchid.preparation.inspection import inspect
from clutchid.truck import MANOEUVRES, drive, truck
from clutchid.verbs.reading import REFUSED, reading_of
from fixtures.commands import called

WRONG = {
    "a position the wrong way round": (lambda c: {"position": 0.022 - c["position"]}, 1.0, "sign of the position"),
    "a position in mm called m": (lambda c: {"position": 1e3 * c["position"]}, 1.0, "outside the stroke"),
    "valves that are swapped": (
        lambda c: {"duty_supply": c["duty_exhaust"], "duty_exhaust": c["duty_supply"]}, 1.0, "duty cycles are swapped",
    ),
    "milliseconds called seconds": (lambda c: {}, 1e3, "write the unit of the time as ms"),
    "seconds called milliseconds": (lambda c: {}, 1e-3, "the time stamps are probably in s or ms"),
    "gauge called absolute": (lambda c: {"pressure_a": c["pressure_a"] - 0.95e5}, 1.0, r"looks like Pa\(g\)"),
    "a pressure that never changes": (lambda c: {"pressure_a": 0 * c["position"] + 2e5}, 1.0, "in every sample"),
    "a piston that never moves": (lambda c: {"position": 0 * c["position"] + 0.005}, 1.0, "changes by 0 mm only"),
    "duty cycles that never change": (
        lambda c: {"duty_supply": 0 * c["position"], "duty_exhaust": 0 * c["position"]}, 1.0, "neither duty cycle",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def sound():
    return drive(truck(3), seconds=6.0, seed=2, name="run").log


def spoiled(log, name):
    change, seconds, _ = WRONG[name]
    return replace(log.with_columns(**change(log.columns)), time=log.time * seconds, metadata={})


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_a_bad_recording_is_refused_with_the_sentence_of_look(name, sound, tmp_path, capsys):
    path = tmp_path / "run.parquet"
    write(spoiled(sound, name), path)
    said = inspect(read(path)).bad
    assert any(WRONG[name][2].replace("\\", "") in sentence for sentence in said)
    assert called("fit", path) == 2
    answer = capsys.readouterr()
    assert answer.out == ""
    for sentence in said:
        assert sentence in answer.err
    assert answer.err.rstrip().endswith(REFUSED)


def test_simulate_refuses_it_as_well(sound, tmp_path, capsys):
    log, start, out = (tmp_path / name for name in ("run.parquet", "p.toml", "s.csv"))
    write(spoiled(sound, "valves that are swapped"), log)
    write_parameters(ParameterFile(Actuator()), start)
    for extra, code in (([], 2), (["--force"], 0)):
        assert called("simulate", log, "--parameters", start, "--out", out, *extra) == code
        assert out.exists() == (code == 0)
    answer = capsys.readouterr()
    assert "duty cycles are swapped" in answer.err
    assert "simulated run: position " in answer.out


def test_force_fits_it_with_the_sentence_as_a_warning(sound):
    bad = spoiled(sound, "a pressure that never changes")
    with pytest.raises(DataError, match="in every sample"):
        reading_of([sound, bad]).checked(Actuator())
    first, second = reading_of([sound, bad], force=True).checked(Actuator())
    assert not first.warnings
    assert any("in every sample" in warning for warning in second.warnings)


def test_a_recording_of_a_few_samples_is_refused(sound):
    for count in (1, 50, 150):
        with pytest.raises(DataError, match="less than a stroke, so nothing can be fitted"):
            reading_of(sound.slice(0, count)).checked(Actuator())


@pytest.mark.slow
@pytest.mark.parametrize("manoeuvre", sorted(MANOEUVRES))
@pytest.mark.parametrize("number", [0, 6])
@pytest.mark.parametrize("recorder", ["controller", "bus"])
def test_no_drive_of_a_virtual_truck_needs_force(manoeuvre, number, recorder):
    log = drive(truck(number), manoeuvre=manoeuvre, seconds=12.0, seed=1, recorder=recorder).log
    assert inspect(log).bad == ()


def test_no_sound_recording_beside_the_repository_needs_force(shared):
    for path in sorted((shared / "data" / "trucks").glob("*/*.csv")):
        assert inspect(read(path)).bad == (), path.name
