"""Files from elsewhere as a user meets them: look, save the map, fit with it; and a long one cut."""

from __future__ import annotations

import json
import re
import tomllib
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clutchid
from clutchid import truck as virtual
from clutchid.log import INPUTS, Log
from clutchid.measurements import read, write
from fixtures.air_on_the_bus import CLUTCH, DBC
from fixtures.commands import called


@pytest.fixture(scope="module")
def log() -> Log:
    """Six seconds of a virtual truck, position only, as the controller records them."""
    driven = virtual.drive(virtual.truck(1), manoeuvre="strokes", seconds=6, seed=1, pressure=False, name="strokes")
    return driven.log


@pytest.fixture(scope="module")
def peak(log: Log, tmp_path_factory: pytest.TempPathFactory) -> float:
    """The peak load that a fit finds in the file of the contract."""
    path = tmp_path_factory.mktemp("contract") / "strokes.csv"
    write(log, path)
    return fitted(path)


def fitted(*arguments: str | Path) -> float:
    with redirect_stdout(StringIO()) as out:
        assert called("fit", *arguments, "--json") == 0
    return max(json.loads(out.getvalue())["load_curve"]["force_N"])


def german(log: Log, path: Path) -> Path:
    """What a German measuring program writes: units in a row of their own, decimal commas, semicolons, Windows-1252."""
    rows = [["Prüfstand 7"], ["Zeit", "Kupplungsweg", "Tastverhältnis Belüftung", "Tastverhältnis Entlüftung", "Öl"]]
    rows.append(["ms", "mm", "%", "%", "°C"])
    scaled = (1e3 * log.time, -1e3 * log["position"], 100 * log["duty_supply"], 100 * log["duty_exhaust"])
    rows += [[f"{value:.5f}".replace(".", ",") for value in row] + ["80,5"] for row in zip(*scaled, strict=True)]
    path.write_bytes("\r\n".join(";".join(row) for row in rows).encode("cp1252"))
    return path


def test_a_german_file_is_fitted_after_one_line_of_its_map_is_mended(tmp_path, log, peak, capsys):
    file, chosen = german(log, tmp_path / "Messung.csv"), tmp_path / "MAP.toml"
    assert called("look", file, "--save", chosen) == 0
    said = capsys.readouterr().out
    for line in (
        "position         Kupplungsweg",
        "duty_supply      Tastverhältnis Belüftung",
        "6,000 samples, 5.999 s",
    ):
        assert line in said
    assert "against the motion" in said or "sign of position" in said
    entry, text = 'channel = "Kupplungsweg"', chosen.read_text(encoding="utf-8")
    chosen.write_text(text.replace(entry, f"{entry}\nsign = -1", 1), encoding="utf-8")
    assert fitted(file, "--map", chosen) == pytest.approx(peak, rel=1e-4)


def test_a_bus_log_is_decoded_and_fitted(tmp_path, log, peak, capsys):
    can = pytest.importorskip("can", reason="reading CAN logs is an extra")
    (tmp_path / "truck.dbc").write_text(DBC)
    with can.Logger(str(tmp_path / "bus.blf")) as bus:
        columns = [log["position"] * 1e6 + 1e4, *(log[name] * 5e4 for name in INPUTS)]
        payloads = np.rint(np.column_stack(columns)).astype("<u2")
        for t, row in zip(1.7e9 + log.time, payloads, strict=True):
            for stamp, identifier, data in ((t, CLUTCH, row.tobytes() + bytes(2)), (t + 2e-4, 512, bytes(8))):
                bus.on_message_received(can.Message(stamp, identifier, is_extended_id=False, data=data))
    assert called("look", tmp_path / "bus.blf") == 2
    assert "of 2 identifiers; give the DBC with --dbc FILE." in capsys.readouterr().out
    chosen = tmp_path / "MAP.toml"
    assert called("look", tmp_path / "bus.blf", "--dbc", tmp_path / "truck.dbc", "--save", chosen) == 0
    assert '"truck.dbc"' in chosen.read_text()
    assert fitted(tmp_path / "bus.blf", "--map", chosen) == pytest.approx(peak, rel=2e-3)


def test_a_bus_log_whose_signals_are_called_like_the_quantities_is_checked_without_a_map(tmp_path, capsys):
    signals = ("position : 0|16@1+ (0.001,0)", "duty_supply : 16|8@1+ (0.5,0)", "duty_exhaust : 24|8@1+ (0.5,0)")
    units = ("mm", "%", "%")
    lines = [f' SG_ {text} [0|100] "{unit}" X' for text, unit in zip(signals, units, strict=True)]
    (tmp_path / "bus.dbc").write_text("\n".join(['VERSION ""', "BU_: X", "BO_ 256 Clutch: 4 X", *lines, ""]))
    rows = [f"({0.001 * i:.6f}) can0 100#{i % 256:02X}{i // 256:02X}00C8" for i in range(400)]
    (tmp_path / "bus.log").write_text("\n".join([*rows, ""]))
    assert called("look", tmp_path / "bus.log", "--dbc", tmp_path / "bus.dbc") == 0
    assert "9 checks" in capsys.readouterr().out


def late_mdf(log: Log, folder: Path) -> tuple[Path, Path]:
    """An MDF 4 file with German names whose duty cycles start a sample after the position, and its map."""
    asammdf = pytest.importorskip("asammdf", reason="reading MDF is an extra")
    path, chosen = folder / "Messung.mf4", folder / "MAP.toml"
    names = {"position": "Kupplungsweg", "duty_supply": "TV_Belueften", "duty_exhaust": "TV_Entlueften"}
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(1e3 * log["position"], log.time, unit="mm", name=names["position"])])
        late = [(names[name], 100 * log[name][1:]) for name in INPUTS]
        mdf.append([asammdf.Signal(values, log.time[1:], unit="%", name=name) for name, values in late])
        mdf.save(path)
    chosen.write_text("".join(f'[{name}]\nchannel = "{channel}"\n' for name, channel in names.items()))
    return path, chosen


def answered(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> dict[str, Any]:
    """The JSON object of a command."""
    capsys.readouterr()
    assert called(*arguments, "--json") == 0
    return dict(json.loads(capsys.readouterr().out))


def test_duty_cycles_that_start_a_sample_late_give_the_load_of_the_csv_and_the_errors_of_its_simulation(
    tmp_path, log, capsys
):
    write(log, tmp_path / "run.csv")
    path, chosen = late_mdf(log, tmp_path)
    assert np.isnan(read(path, channels=chosen)["duty_supply"]).nonzero()[0].tolist() == [0]
    fits = [answered(capsys, "fit", tmp_path / "run.csv")]
    fits.append(answered(capsys, "fit", path, "--map", chosen, "--save", tmp_path / "FIT.toml"))
    assert not any("its start was estimated" in note for fit in fits for note in fit["notes"])
    # the sample at rest depends on no parameter; the search stops within 1e-9 of the least cost n / 2, so at 1e-9 n of
    # the squared standard error
    within = np.sqrt(1e-9 * len(log))
    for name, fit in fits[0]["parameters"].items():
        assert fits[1]["parameters"][name]["value"] == pytest.approx(fit["value"], rel=1e-6, abs=within * fit["std"])
    out = tmp_path / "SIM.parquet"
    response = answered(capsys, "simulate", path, "--map", chosen, "--parameters", tmp_path / "FIT.toml", "--out", out)
    assert response["errors"] == fits[1]["errors"]
    simulated = read(out)
    assert np.array_equal(simulated.time, read(path, channels=chosen).time)
    assert np.isnan(simulated["position"]).nonzero()[0].tolist() == [0]


def test_a_start_that_was_estimated_is_said_saved_and_used(tmp_path, log, capsys):
    moving = int(np.argmax(log["position"] > 5e-3))
    part = log.slice(moving, len(log))
    late = {name: np.r_[np.nan, part[name][1:]] for name in INPUTS}
    write(part.with_columns(**late), tmp_path / "moving.csv")
    fit = answered(capsys, "fit", tmp_path / "moving.csv", "--save", tmp_path / "FIT.toml")
    (note,) = [note for note in fit["notes"] if "its start was estimated" in note]
    assert note.startswith("moving: does not start vented and at rest, so its start was estimated: position ")
    starts = tomllib.loads((tmp_path / "FIT.toml").read_text())["recording"]["moving"]
    assert f"position {1e3 * starts['position_start'][0]:.3g} mm" in note
    assert f"pressure {1e-5 * starts['pressure_a_start'][0]:.4g} bar" in note
    options = ("--parameters", tmp_path / "FIT.toml", "--out", tmp_path / "SIM.csv")
    assert answered(capsys, "simulate", tmp_path / "moving.csv", *options)["errors"] == fit["errors"]


def test_a_long_recording_is_cut_and_what_was_chosen_is_fitted(tmp_path, capsys):
    driven = virtual.drive(virtual.truck(1), manoeuvre="strokes", seconds=40, seed=1, pressure=False, name="long")
    write(driven.log, tmp_path / "long.parquet")
    best = tmp_path / "best.mf4"
    assert called("cut", tmp_path / "long.parquet", "--out", best, "--seconds", "6") == 0
    said = capsys.readouterr().out
    assert re.search(r"\d+ strokes, \d+ rests\nchosen: \d of them, [345]\.\d\d s, from \d", said)
    chosen = read(best)
    assert 3000 < len(chosen) <= 6100
    assert np.isin(chosen.time, driven.log.time).all()
    assert fitted(best) > 0


def test_a_stroke_that_is_divided_at_a_long_hold_is_said_in_python_and_on_the_command_line(tmp_path, capsys):
    time = np.arange(0.0, 20.0, 1e-3)
    position = np.interp(time, [2.0, 2.1, 15.0, 15.3], [0.0, 0.02, 0.02, 0.0])
    inputs = {name: np.zeros(time.size) for name in INPUTS}
    write(Log(time, {"position": position, **inputs}), tmp_path / "held.parquet")
    assert called("cut", tmp_path / "held.parquet", "--out", tmp_path / "best.csv") == 0
    sentence = (
        "a stroke ends where it is held for 10 s or longer, and the rest of it counts as another stroke: once at "
    )
    assert f"warning: {sentence}" in capsys.readouterr().err
    (warning,) = clutchid.cut(tmp_path / "held.parquet").warnings
    assert warning.startswith(sentence)


def test_nothing_is_written_where_nothing_could_be_fitted(tmp_path, capsys):
    time = np.arange(2000) / 1000
    still = {"position": np.zeros(2000), "duty_supply": np.zeros(2000), "duty_exhaust": np.zeros(2000)}
    write(Log(time, still), tmp_path / "still.csv")
    assert called("cut", tmp_path / "still.csv", "--out", tmp_path / "best.csv") == 2
    assert "no usable stroke of at most 60 s was found" in capsys.readouterr().err
    assert not (tmp_path / "best.csv").exists()


def test_a_map_or_a_database_that_is_not_there_is_one_clear_sentence(tmp_path, log, capsys):
    write(log, tmp_path / "run.csv")
    assert called("fit", tmp_path / "run.csv", "--map", tmp_path / "NO.toml") == 2
    assert "there is no such file" in capsys.readouterr().err
    assert called("look", tmp_path / "run.csv", "--dbc", tmp_path / "NO.dbc") == 2
    assert called("look", tmp_path / "run.csv", "--save", tmp_path / "run.csv") == 2
    assert "is the recording itself" in capsys.readouterr().err
