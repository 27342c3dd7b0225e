"""A verb through every door, Python, command line, page and fleet: the same numbers and the same sentences."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

import clutchid
from clutchid import Log
from clutchid.app import records, tasks
from clutchid.app.commands import fit_command
from clutchid.errors import ClutchidError
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.observer.by_stroke import curve, curve_positions
from clutchid.verbs.observing import ANYWAY
from clutchid.verbs.reading import REFUSED, Reading
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.history import RecordingJob
from fixtures.commands import called

pytestmark = pytest.mark.usefixtures("blank")  # no door is asked what it draws

Change = Callable[[Log], Log]


def _column(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda log: log.with_columns(**{name: change(log[name])})


#: Recordings that can be read, and those that cannot, by what they are.
GOOD: Mapping[str, Change] = {
    "as recorded": lambda log: log,
    "with a sensor that was set to zero anew": _column("position", lambda y: y + 8e-4),
    "with a code for none": _column("position", lambda y: np.where(np.arange(y.size) % 1500 == 700, 65.535e-3, y)),
}
BAD: Mapping[str, Change] = {
    "with the position the wrong way round": _column("position", lambda y: 0.022 - y),
    "with millimetres called metres": _column("position", lambda y: 1e3 * y),
    "with the valves swapped": lambda log: log.with_columns(
        duty_supply=log["duty_exhaust"], duty_exhaust=log["duty_supply"]
    ),
    "with milliseconds called seconds": lambda log: replace(log, time=1e3 * log.time),
    "of a tenth of a second": lambda log: log.slice(0, 100),
    "without a position": lambda log: log.without("position"),
    "without the exhaust valve": lambda log: log.without("duty_exhaust"),
    "that stands still": _column("position", np.zeros_like),
}
NO_RECORDINGS = {"empty": b"", "text": b"no recording\n"}


class Answer(NamedTuple):
    """The load at 6 mm in N, and that at the last stroke, or the sentence of a refusal."""

    force: float = np.nan
    sentence: str = ""
    by_stroke: float = np.nan

    def agrees(self, other: Answer) -> bool:
        """Whether a force is the same up to rounding, and the sentences are the same."""
        same = [first == pytest.approx(two, rel=1e-9) for first, two in zip(self[::2], other[::2], strict=True)]
        return self.sentence == other.sentence and (any(same) or bool(self.sentence))


def at_6_mm(curve: LoadCurve | Mapping[str, list[float]]) -> float:
    """Force in N of a load, a result's or that of a JSON object."""
    position, force = (
        (curve["position_m"], curve["force_N"]) if isinstance(curve, Mapping) else (curve.position, curve.force)
    )
    (at,) = np.flatnonzero(np.isclose(position, 6e-3, rtol=0.0, atol=1e-9))
    return float(force[at])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A calibration, and the recordings of a worn clutch by name."""
    folder = tmp_path_factory.mktemp("doors")
    log = clutchid.bundled_recording()
    calibration = clutchid.calibrate(log.slice(0, 4000), free="load,P_S")
    clutchid.write_parameters(clutchid.parameter_file(calibration), folder / "cal.toml")
    sound = log.slice(4000, 10_000).without("pressure_a")
    for name, change in {**GOOD, **BAD}.items():
        clutchid.write(change(sound), folder / f"{name}.csv")
    for name, content in NO_RECORDINGS.items():
        (folder / f"{name}.csv").write_bytes(content)
    return folder


def by_python(verb: str, path: Path, start: Path, **options: object) -> Answer:
    try:
        result = getattr(clutchid, verb)(path, start, **options)
    except ClutchidError as error:
        return Answer(sentence=str(error))
    if verb == "estimate":
        return Answer(at_6_mm(result.load_curve))
    now = curve(result.observer, result.after, curve_positions(result.observer))
    return Answer(at_6_mm(now), by_stroke=at_6_mm(result.strokes[-1].curve))


def by_command(verb: str, path: Path, start: Path, capsys, **options: object) -> Answer:
    out = ["--out", path.with_suffix(".out.csv")] if verb == "observe" else []
    words = [word for name, value in options.items() for word in (f"--{name}", *([] if value is True else [value]))]
    called(verb, path, "--start", start, *out, *words, "--json")
    answer = json.loads(capsys.readouterr().out)
    if answer["status"] in ("bad_input", "failed"):
        return Answer(sentence=answer["message"])
    return Answer(at_6_mm(answer["load_curve"]))


def by_page(verb: str, path: Path, start: Path, folder: Path, **options: object) -> Answer:
    events = SimpleNamespace(progress=lambda *_: None, part=lambda *_: None)
    file = records.File(path, name=path.name)
    try:
        if verb == "observe":
            result = tasks.observe(records.Observe(file, start, "joint", folder, **options), events)
            return Answer(by_stroke=at_6_mm(result["loads"][-1]["curve"]))
        asked = fit_command(verb, options, [file], start=start.name)
        result = tasks.fit(records.FitRecordings(asked, verb, (file,), folder, start=start), events)
    except ClutchidError as error:
        return Answer(sentence=str(error))
    return Answer(at_6_mm(result["load_curve"]))


def by_fleet(verb: str, path: Path, start: Path) -> Answer:
    job = RecordingJob(path.stem, path=path, start=start)
    read = read_recording(Reading(), "fit" if verb == "estimate" else verb, job)
    return Answer(sentence=read.message) if read.curve is None else Answer(at_6_mm(read.curve))


def _in_a_fleet(answer: Answer) -> Answer:
    """The answer as a fleet gives it, where nobody can go on with one recording of many."""
    alone = " Correct the recording or its channel map, or estimate this recording alone with --force."
    return answer._replace(sentence=answer.sentence.replace(f"\n{REFUSED}", alone).removesuffix(ANYWAY))


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["estimate", "observe"])
@pytest.mark.parametrize("name", [*GOOD, *BAD, *NO_RECORDINGS])
def test_the_doors_agree(verb, name, folder, capsys, tmp_path):
    path, start = folder / f"{name}.csv", folder / "cal.toml"
    answer = by_python(verb, path, start)
    assert (answer.sentence == "") == (name in GOOD), answer
    assert by_command(verb, path, start, capsys).agrees(answer)
    assert by_page(verb, path, start, tmp_path).agrees(answer)
    assert by_fleet(verb, path, start).agrees(_in_a_fleet(answer))


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["estimate", "observe"])
def test_force_goes_on_at_every_door(verb, folder, capsys, tmp_path):
    """Not in a fleet, whose recordings nobody looks at one by one."""
    path, start = folder / "with the valves swapped.csv", folder / "cal.toml"
    answer = by_python(verb, path, start, force=True)
    assert REFUSED not in answer.sentence
    assert by_command(verb, path, start, capsys, force=True).agrees(answer)
    assert by_page(verb, path, start, tmp_path, force=True).agrees(answer)


def test_a_simulation_is_refused_as_well_and_goes_on_with_the_sentence_as_a_warning(folder, capsys, tmp_path):
    path, out = folder / "with the valves swapped.csv", tmp_path / "s.csv"
    for extra, code in (([], 2), (["--force"], 0)):
        assert called("simulate", path, "--parameters", folder / "cal.toml", "--out", out, *extra) == code
        assert out.exists() == (code == 0)
        assert "duty cycles are swapped" in capsys.readouterr().err


def test_a_log_that_has_been_read_is_checked_as_its_file_is(folder):
    path = folder / "with the position the wrong way round.csv"
    log = clutchid.read(path)
    answer = by_python("estimate", path, folder / "cal.toml")
    assert answer.sentence
    assert by_python("estimate", log, folder / "cal.toml").agrees(answer)
    short = by_python("estimate", log.slice(0, 1), folder / "cal.toml")
    assert "the position has 1 samples in 0 s, less than a stroke, so nothing can be fitted" in short.sentence
    with pytest.raises(clutchid.ParameterError, match=r"ambient = 100000\.0: is an option for reading files"):
        clutchid.estimate(log, folder / "cal.toml", ambient=1e5)


@pytest.mark.parametrize("columns", [("duty_supply",), ("duty_supply", "duty_exhaust")])
def test_duty_cycles_in_percent_are_refused_by_every_verb_as_in_a_file(columns, folder, tmp_path):
    """Not by force either: what opens a valve is unknown."""
    log, start = clutchid.read(folder / "as recorded.csv"), folder / "cal.toml"
    wrong = log.with_columns(**{name: 100.0 * log[name] for name in columns})
    actuator = clutchid.read_parameters(start).actuator
    verbs = {
        "fit": lambda: clutchid.fit(wrong, force=True),
        "calibrate": lambda: clutchid.calibrate(wrong, free="load", measure="position"),
        "verify": lambda: clutchid.fit(log, verify=wrong),
        "estimate": lambda: clutchid.estimate(wrong, start),
        "observe": lambda: clutchid.observe(wrong, start),
        "simulate": lambda: clutchid.simulate(actuator, wrong, force=True),
        "simulate_many": lambda: clutchid.simulate_many(actuator, [log, wrong]),
        "cut": lambda: clutchid.cut(wrong),
    }
    clutchid.write(wrong, tmp_path / "wrong.csv")
    with pytest.raises(clutchid.DataError) as of_file:
        clutchid.fit(tmp_path / "wrong.csv")
    advice = "looks like percent: write duty_supply [%]."
    assert advice in str(of_file.value)
    for verb, call in verbs.items():
        with pytest.raises(clutchid.DataError) as caught:
            call()
        assert advice in str(caught.value), verb
        assert str(caught.value).endswith("clutchid.Log.from_frame(frame) converts units in headings."), verb


def test_a_position_in_mm_is_refused_by_a_simulation_in_python_unless_by_force(folder):
    log, actuator = clutchid.read(folder / "with millimetres called metres.csv"), clutchid.Actuator()
    for simulate in (clutchid.simulate, clutchid.simulate_many):
        with pytest.raises(clutchid.DataError, match=r"outside the stroke of 0 to 25 mm; .*\n.* force=True"):
            simulate(actuator, log)
    assert "outside the stroke" in clutchid.simulate(actuator, log, force=True).warnings[-1]
    assert "outside the stroke" in clutchid.simulate_many(actuator, [log], force=True)[0].warnings[-1]
