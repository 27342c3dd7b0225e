"""Inputs as vehicles have them: Python and the exported C follow the same rules, and the load stays what it was.

The load after a recording with a fault is compared with that after the same recording without it; each fault alone made
it wrong before, in silence.
"""

import re
import subprocess
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from clutchid.estimation.assess.observed import TRUSTS, indicators, observed_verdict
from clutchid.exports.c99 import CStyle, observer_c99
from clutchid.exports.outputs import REASONS
from clutchid.exports.parity import RESULT_COLUMNS, begins_us, parity, replay, replay_program, replayed
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.log import Log
from clutchid.observer import observer, start
from clutchid.observer.by_stroke import curve
from clutchid.observer.health import FLAGS
from clutchid.observer.run import observe_recording
from clutchid.simulation import simulate
from clutchid.strokes.vented_rest import vented_rest
from fixtures.changed_logs import picked, spoiled
from fixtures.export_c import compiled, write_sources
from fixtures.programs import path_of

DOUBLE = CStyle(real="double")
ENGAGING = np.linspace(5e-3, 8e-3, 13)


@pytest.fixture(scope="module")
def log(plant, recorded_by):
    """A worn clutch that records its supply pressure, at 1 kHz in whole microseconds."""
    worn = plant.replace({n: 1.08 * v for n, v in zip(plant.load.names, plant.load.theta, strict=True)})
    made = recorded_by(worn, seconds=8.0).without("pressure_a")
    supply = 9.5e5 + 2e3 * np.random.default_rng(2).standard_normal(len(made))
    return made.with_columns(pressure_supply=supply)


@pytest.fixture(scope="module")
def estimator(plant, log):
    conditions = RecordedConditions(supply=9.5e5, supply_estimated=plant.value("P_S"))
    rest = vented_rest(log.slice(0, 4000))
    return observer(plant, calibration=Calibration((), np.zeros((0, 0)), conditions=conditions, nis=0.05, rest=rest))


def every(log, n, first=0):
    return np.arange(len(log)) % n == first


def scaled(log, factor=1.0, add=0.0):
    return log.with_columns(pressure_supply=factor * log["pressure_supply"] + add)


def far_supply(log):
    late = np.arange(len(log)) >= 2500
    return log.with_columns(pressure_supply=log["pressure_supply"] * np.where(late, 1.12, 1.0))


def of_half(log, column, value):
    """A closed valve that is read as another value in half of the samples."""
    closed = (log[column] <= 0.0) & (np.random.default_rng(0).random(len(log)) < 0.5)
    return log.with_columns(**{column: np.where(closed, value, log[column])})


def held(log, seconds=1.5):
    """Duty cycles that stay as they are while the exhaust valve is open."""
    at = 3000 + int(np.argmax(log["duty_exhaust"][3000:] > 0.5))
    span = slice(at, at + round(1e3 * seconds))
    stuck = spoiled(log, "duty_exhaust", span, log["duty_exhaust"][at])
    return spoiled(stuck, "duty_supply", span, log["duty_supply"][at])


def in_a_stroke(log):
    return 4000 + int(np.argmax(log["position"][4000:] > 4e-3))


def without(log, first, samples=100):
    """With a hole, after which the states begin anew."""
    return picked(log, (np.arange(len(log)) < first) | (np.arange(len(log)) >= first + samples))


#: Faults: the recording with it, the flag that says so, and how far the load may move in % of the peak.
FAULTS = {
    "supply of 0 Pa": (lambda log: scaled(log, 0.0), "supply_unlike", 2.0),
    "supply in bar": (lambda log: scaled(log, 1e-5), "supply_unlike", 2.0),
    "supply of 50 bar": (lambda log: scaled(log, 0.0, 5e6), "supply_unlike", 2.0),
    "supply as gauge": (lambda log: scaled(log, 1.0, -101325.0), "supply_unlike", 2.0),
    "supply off by 12 %": (far_supply, "supply_unlike", 3.0),
    "supply lost": (lambda log: spoiled(log, "pressure_supply", slice(2000, None), 0.0), "supply_unlike", 2.0),
    "a sample far outside": (lambda log: spoiled(log, "position", in_a_stroke(log), -3e34), "position_none", 0.5),
    "six of a hundred lost": (lambda log: picked(log, np.arange(len(log)) % 100 >= 6), "time_missing", 3.0),
    "duty cycles missing": (lambda log: spoiled(log, "duty_supply", every(log, 50, 7)), "duty_missing", 2.0),
    "closed read as below 0": (lambda log: of_half(log, "duty_supply", -1e-4), None, 0.01),
    "duty cycles held": (held, "contradiction", 2.0),
    "a hole in a stroke": (lambda log: without(log, in_a_stroke(log)), "time_missing", 2.0),
    "a sensor off by 0.4 mm": (lambda log: log.with_columns(position=log["position"] + 4e-4), "rest_moved", 3.0),
    "dropouts to 0": (lambda log: spoiled(log, "position", np.arange(len(log)) % 150 < 2, 0.0), "position_jumps", 2.0),
}  # fmt: skip


@pytest.fixture(scope="module")
def load_of(estimator, log):
    """The load where the clutch engages after a recording, in % of its peak, and the run: load_of(log)."""

    @cache
    def found(name):
        run = observe_recording(estimator, FAULTS[name][0](log) if name else log)
        force = estimator.load(run.after).force(np.linspace(0.0, 2e-2, 100))
        return 100.0 * curve(estimator, run.after, ENGAGING).force / force.max(), run

    return found


@pytest.mark.parametrize("fault", FAULTS)
def test_the_load_stays_what_it_was_and_a_flag_says_why(load_of, fault):
    _, flag, most = FAULTS[fault]
    (sound, undisturbed), (force, run) = load_of(""), load_of(fault)
    assert np.abs(force - sound).max() < most
    assert run.after.strokes == undisturbed.after.strokes
    if flag:
        assert run.health[flag] > 0.0
        assert not undisturbed.health[flag]


#: Words of the reasons in Python by their name in C.
SAID = {
    "calibration": "settled vented rest", "strokes": "ended, fewer than", "band": "the band of the load",
    "mismatch": "innovation in motion (NIS", "supply": "the supply pressure was", "rest": "and was not subtracted",
    "zero": "the position jumped", "flags": "% of the last",
}  # fmt: skip


@pytest.fixture(scope="module")
def program(estimator, log, tmp_path_factory):
    """The observer in C with the program that runs a recording through it."""
    cc = path_of("cc")
    modules = observer_c99(estimator, start(estimator), DOUBLE, "a test")
    return replay_program(estimator, modules, DOUBLE, begins_us(log), cc, tmp_path_factory.mktemp("c"))


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_c_follows_the_same_rules(estimator, log, program, fault):
    disturbed = FAULTS[fault][0](log)
    in_c = replayed(program, estimator, disturbed)
    compared = parity(estimator, start(estimator), disturbed, in_c)
    assert compared.flags == {}
    assert compared.holds(DOUBLE), compared
    verdict = observed_verdict(indicators(observe_recording(estimator, disturbed)))
    trust, reasons = (in_c.outputs[:, RESULT_COLUMNS.index(name)].astype(int) for name in ("trust", "reasons"))
    assert TRUSTS[trust[-1]] == verdict.trust
    assert np.array_equal(trust == 2, reasons == 0)
    because = {name for bit, name in enumerate(REASONS) if reasons[-1] >> bit & 1}
    assert because == {name for name, words in SAID.items() if any(words in reason for reason in verdict.reasons)}


@pytest.mark.slow
def test_c_begins_at_the_far_stop_as_python_does(estimator, log, program):
    p, head = estimator.actuator.parameters, log.slice(0, 200)
    position = p.y_max + 3e-5 * np.random.default_rng(0).standard_normal(len(head))
    closed = np.zeros(len(head))
    at_stop = head.with_columns(position=position, duty_supply=closed, duty_exhaust=closed)
    in_c = replayed(program, estimator, at_stop)
    assert in_c.outputs[0, RESULT_COLUMNS.index("pressure_a")] > 0.4 * (p.P_0 + p.P_S)
    compared = parity(estimator, start(estimator), at_stop, in_c)
    assert compared.flags == {}
    assert compared.holds(DOUBLE), compared


@pytest.mark.slow
def test_a_sensor_that_moves_by_less_than_a_jump_is_found_by_rests_that_agree(plant):
    """In Python and in C, where friction holds the piston far above its stop after a stroke."""
    cc = path_of("cc")
    time = 1e-3 * np.arange(17_000)
    duties = {
        "duty_supply": (time % 1.6 > 0.4) * (time % 1.6 < 0.6) * 1.0,
        "duty_exhaust": (time % 1.6 > 0.8) * (time % 1.6 < 1.5) * 1.0,
    }
    simulated = simulate(plant, Log(time, duties)).log["position"]
    noise = 1e-5 * np.random.default_rng(0).standard_normal(time.size)
    log = Log(time, {**duties, "position": simulated + noise + 5e-4 * (time > 0.47) + 3e-4 * (time > 8.47)})
    held = observer(plant, calibration=Calibration((), np.zeros((0, 0)), rest=vented_rest(log.slice(0, 8000))))
    assert held.calibration.rest.held > 4e-4
    run, state = observe_recording(held, log), start(held)
    assert run.after.rest_shift == pytest.approx(3e-4, abs=3e-5)
    compared = parity(held, state, log, replay(held, observer_c99(held, state, DOUBLE, "a test"), DOUBLE, log, cc))
    assert compared.flags == {}
    assert compared.holds(DOUBLE), compared


def test_samples_that_repeat_others_change_nothing(estimator, log):
    """A coarse clock, or a task that is called twice."""
    rows = np.sort(np.append(np.arange(len(log)), np.arange(100, 3000, 50)))
    later = np.where(np.diff(rows, prepend=-1) == 0, 5e-5, 0.0)
    columns = {name: values[rows] for name, values in log.columns.items()}
    run = observe_recording(estimator, replace(log, time=log.time[rows] + later, columns=columns))
    assert run.health["repeated"] == pytest.approx(1e-3 * (rows.size - len(log)))
    np.testing.assert_array_equal(run.after.theta, observe_recording(estimator, log).after.theta)


@pytest.mark.slow
def test_every_flag_of_python_is_one_of_c(estimator):
    header = observer_c99(estimator, start(estimator), DOUBLE, "a test")["clutch"].header
    assert all(f"clutch_{flag} = " in header for flag in FLAGS)


MEMORY = """
#include <stdio.h>
#include <string.h>
#include "clutch.h"
static clutch_t self;
static clutch_nvram_t blocks[2];
int main(void)
{
    clutch_band_t band;
    const int before = clutch_store(&clutch_data, &self, blocks);
    const int none = clutch_newest(&clutch_data, blocks) == NULL;
    clutch_start(&clutch_data, &self, NULL, 0u);
    const int first = clutch_store(&clutch_data, &self, blocks);
    clutch_start(&clutch_data, &self, clutch_newest(&clutch_data, blocks), 0u);
    const int second = clutch_store(&clutch_data, &self, blocks);
    const int newest = (int)(clutch_newest(&clutch_data, blocks) - blocks);
    ((unsigned char *)&blocks[1])[40] ^= 1u;
    const int other = (int)(clutch_newest(&clutch_data, blocks) - blocks);
    clutch_load(&clutch_data, &self, 0.05, &band);
    printf("%d %d %d %d %d %d %d\\n", before, none, first, second, newest, other, band.force != band.force);
    return 0;
}
"""

MEANWHILE = """
#include <stdio.h>
#include "clutch.h"
static clutch_t self;
static clutch_nvram_t blocks[2];
static int barriers;
void meanwhile(void)
{
    barriers += 1;
    if (barriers == 2) { /* all but the checksum is written */
        self.strokes += 1u;
        self.mismatch.stored = 2.0;
        self.zero = 1e-4;
        self.rest.shift = 1e-4;
        self.sound.theta[0] = 0.25;
        self.kept += 1u;
    }
}
int main(void)
{
    clutch_start(&clutch_data, &self, NULL, 0u);
    barriers = 0;
    (void)clutch_store(&clutch_data, &self, blocks);
    const int sound = clutch_newest(&clutch_data, blocks) == &blocks[0];
    printf("%d %u ", sound, (unsigned)blocks[0].strokes);
    printf("%g %g %g\\n", blocks[0].mismatch, blocks[0].rest, blocks[0].theta[0]);
    return 0;
}
"""

LATE = """
#include <stdio.h>
#include "clutch.h"
static clutch_t self;
int main(void)
{
    clutch_start(&clutch_data, &self, NULL, 0u);
    for (int i = 0; i < 2000; i++) {
        const clutch_input_t input = { 1e-5 * (i % 7), 0.0, 0.0, 0.0 };
        clutch_output_t output;
        clutch_fast(&clutch_data, &self, &input, (i == 500) ? 0u : 1000u, &output);
        if (i < 1000) { (void)clutch_slow(&clutch_data, &self); }
        if (i == 999) { printf("%u ", (unsigned)self.health[clutch_late_correction]); }
    }
    printf("%u %u\\n", (unsigned)self.health[clutch_late_correction], (unsigned)self.health[clutch_repeated]);
    return 0;
}
"""

COLUMNS_MOVED = """
#include <stdio.h>
#include "clutch.h"
static clutch_t self;
static unsigned steps, columns_moved;
void __real_clutch_model_step_columns(double *, double *, double *, int, int, const double *, const void *,
    const void *, const void *, const void *, void *, double);
void __wrap_clutch_model_step_columns(double *x, double *carry, double *S, int columns, int rows, const double *p,
    const void *c, const void *held, const void *table, const void *basis, void *memory, double h)
{
    steps += 1u;
    columns_moved += (unsigned)columns;
    __real_clutch_model_step_columns(x, carry, S, columns, rows, p, c, held, table, basis, memory, h);
}
int main(void)
{
    static const unsigned since[] = { 1000u, 5000u, 1000u, 20000u };
    clutch_start(&clutch_data, &self, NULL, 0u);
    for (int i = 0; i < 240; i++) {
        const clutch_input_t input = { 1e-5 * (i % 7), (i > 100) ? 0.6 : 0.0, 0.0, 0.0 };
        const unsigned dt = (i % 30 == 20) ? since[(i / 30) % 4] : 1000u;
        clutch_output_t output;
        steps = 0u;
        columns_moved = 0u;
        clutch_fast(&clutch_data, &self, &input, dt, &output);
        if (i % 30 == 20) { printf("%u %u %u\\n", dt, steps, columns_moved); }
    }
    return 0;
}
"""


CALIBRATED = """
#include <stdio.h>
#include "clutch.h"
static clutch_t self;
static clutch_nvram_t blocks[2];
int main(void)
{
    (void)fread(&blocks[0], sizeof(blocks[0]), 1u, stdin);
    const int known = clutch_newest(&clutch_data, blocks) != NULL;
    clutch_start(&clutch_data, &self, NULL, 0u);
    (void)clutch_store(&clutch_data, &self, blocks);
    (void)fwrite(&blocks[0], sizeof(blocks[0]), 1u, stdout);
    (void)fprintf(stderr, "%d", known);
    return 0;
}
"""


def words_of(estimator, style, main, folder, *linking):
    """Words that a program in C prints that calls an observer."""
    sources = write_sources(estimator, style, folder / "src")
    (folder / "main.c").write_text(main)
    path_of("cc with sanitizers")
    options = ("-I", str(folder / "src"), "-fsanitize=undefined,address", "-fno-sanitize-recover=all")
    program = compiled([folder / "main.c", *sources], folder / "main", *options, *linking)
    return subprocess.run([program], capture_output=True, check=True, text=True).stdout.split()


@pytest.mark.slow
def test_a_block_is_not_written_before_the_start_and_the_newer_sound_one_of_two_counts(estimator, tmp_path):
    assert words_of(estimator, DOUBLE, MEMORY, tmp_path) == ["0", "1", "1", "1", "1", "0", "1"]


@pytest.mark.slow
def test_a_block_is_of_one_instant_where_a_stroke_ends_while_it_is_written(estimator, tmp_path):
    """As the fast task does that interrupts a store: between the barriers of both tasks."""
    (tmp_path / "meanwhile.h").write_text("void meanwhile(void);\n")
    options = ("-include", str(tmp_path / "meanwhile.h"), "-DCLUTCH_BARRIER()=meanwhile()")
    words = words_of(estimator, CStyle(real="double", rates="two"), MEANWHILE, tmp_path, *options)
    assert words == ["1", "1", "2", "0.0001", "0.25"]


@pytest.mark.slow
def test_a_slow_task_that_never_runs_is_a_flag(estimator, tmp_path):
    soon, late, repeated = words_of(estimator, CStyle(real="double", rates="two"), LATE, tmp_path)
    assert (soon, repeated) == ("0", "1")
    assert int(late) >= 90


@pytest.mark.slow
def test_a_block_is_of_the_values_that_a_tool_has_changed(estimator, tmp_path):
    """What is stored is in standard deviations from values that a measurement tool may calibrate."""
    sources = write_sources(estimator, DOUBLE, tmp_path / "src")
    (tmp_path / "main.c").write_text(CALIBRATED)
    data = tmp_path / "src" / "clutch_data.c"

    def run(block):
        program = compiled([tmp_path / "main.c", *sources], tmp_path / "main", "-I", str(tmp_path / "src"))
        process = subprocess.run([program], input=block, capture_output=True, check=True)
        return process.stdout, process.stderr.decode()

    stored, first = run(b"")
    assert (first, run(stored)[1]) == ("0", "1")
    mean = re.search(r"/\* F_C \*/\s*([0-9.e+-]+),", data.read_text())
    data.write_text(data.read_text().replace(mean.group(1), repr(1.1 * float(mean.group(1)))))
    assert run(stored)[1] == "0"


@pytest.mark.slow
def test_a_late_sample_moves_no_more_columns_than_one_in_time(estimator, tmp_path):
    """Columns are two thirds of a step: a late sample that moves them step by step takes the time of several."""
    words = words_of(estimator, DOUBLE, COLUMNS_MOVED, tmp_path, "-Wl,--wrap=clutch_model_step_columns")
    usual, five, _, twenty = np.array(words, dtype=int).reshape(2, 4, 3).transpose(1, 0, 2)
    assert np.all(usual[:, 1] < five[:, 1])
    assert np.all(five[:, 1] < twenty[:, 1])
    assert max(five[:, 2].max(), twenty[:, 2].max()) <= usual[:, 2].min()
