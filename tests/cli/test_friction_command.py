"""``clutchid friction``: tables, sentence and the one JSON object. Reading is not tested here."""

import json

import numpy as np
import pytest

from clutchid.log import Log
from fixtures.commands import called
from fixtures.friction import simulated_force

# the package's name `friction` is the verb

BLOCK = {"F_C": 2.0, "K_z": 2e4, "D_v": 300.0, "D_zdot": 200.0, "force_zero": 0.1}


def levels() -> list[Log]:
    t = np.arange(0.0, 48.0, 0.02)
    y, way = 0.04 * np.abs((t / 4 + 1) % 2 - 1), np.where(t % 8.0 < 4.0, 1.0, -1.0)
    cycle = (t / 8.0).astype(int)
    logs = []
    for bar in (1, 3, 5):
        noise = 0.1 * np.random.default_rng(bar).standard_normal(6)
        force = 50.0 * bar + (3.0 + 0.8 * bar + noise[cycle]) * way
        logs.append(
            Log(t, {"position": y, "force": force, "pressure_a": np.full(t.size, (1 + bar) * 1e5)}, f"{bar}bar")
        )
    return logs


def block() -> list[Log]:
    t = np.arange(4000) * 5e-3
    log = Log(t, {"position": 5e-4 * np.sin(2 * np.pi * t / 4) * (1 + 0.5 * np.sin(2 * np.pi * t / 17))}, "block")
    return [log.with_columns(force=simulated_force(log, BLOCK))]


def friction(monkeypatch, logs, *arguments: str) -> int:
    monkeypatch.setattr("clutchid.verbs.reading.Reading.read", lambda *_, **__: logs)
    return called("friction", "some.csv", *arguments)


def test_levels_intervals_and_the_sentence_are_printed(monkeypatch, capsys):
    assert friction(monkeypatch, levels(), "--ambient", "1bar") == 0
    text = capsys.readouterr().out
    assert [line.split()[0] for line in text.splitlines()[1:4]] == ["1.00", "3.00", "5.00"]
    assert "a constant F_C is inadequate" in text
    assert "energy-balance-stribeck" in text


def test_the_one_object_has_the_levels_and_what_to_set_in_the_model(monkeypatch, capsys):
    assert friction(monkeypatch, levels(), "--ambient", "1bar", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert set(answer["parameters"]) == {"F_C", "c_F"}
    assert answer["parameters"]["c_F"]["low"] < 0.8e-5 < answer["parameters"]["c_F"]["high"]
    assert [round(level["pressure_Pa"]) for level in answer["levels"]] == [100000, 300000, 500000]
    assert {"status", "message", "load_curve", "errors", "logs", "warnings"} <= answer.keys()


def test_lugre_is_fitted_to_each_recording(monkeypatch, capsys):
    assert friction(monkeypatch, block(), "--law", "lugre") == 0
    text = capsys.readouterr().out
    assert "block: fit 100.0 % in free run" in text
    assert friction(monkeypatch, block(), "--law", "lugre", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["parameters"]["F_C@block"]["value"] == pytest.approx(2.0, rel=1e-4)
    assert answer["logs"]["block"]["fit_percent"] > 99.9


def test_a_fixed_stiffness_and_an_inertia_reach_the_fit(monkeypatch, capsys):
    assert friction(monkeypatch, block(), "--law", "lugre", "--fix", "K_z=2e4", "D_zdot=200", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert set(answer["parameters"]) == {"F_C@block", "D_v@block", "force_zero@block"}
    assert answer["parameters"]["F_C@block"]["value"] == pytest.approx(2.0, rel=1e-4)
    assert friction(monkeypatch, block(), "--law", "lugre", "--inertia", "500", "--json") == 0
    heavy = json.loads(capsys.readouterr().out)
    assert heavy["logs"]["block"]["fit_percent"] < answer["logs"]["block"]["fit_percent"] - 1.0


def test_a_number_that_the_law_does_not_have_is_not_fixed(monkeypatch, capsys):
    assert friction(monkeypatch, block(), "--law", "lugre", "--fix", "K_y=1") == 2
    assert "no friction parameter 'K_y'" in capsys.readouterr().err
