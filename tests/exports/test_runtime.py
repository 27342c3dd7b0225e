"""An exported observer on recordings with everything that goes wrong, against the observer in Python."""

import ctypes
import subprocess
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.exports.c99 import CStyle, c_number, observer_c99, source_files
from clutchid.exports.parity import (
    RESULT_COLUMNS,
    begins_us,
    begun,
    parity,
    replay,
    replay_program,
    replayed,
    samples_of,
    trial_drive,
)
from clutchid.inference.uncertainty.calibration import Calibration, PositionOnlyErrors
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.model import Actuator, Load
from clutchid.observer import observe, observer, start
from clutchid.observer.health import FLAGS
from clutchid.strokes.travel import Travel
from clutchid.strokes.vented_rest import vented_rest
from fixtures.changed_logs import picked, spoiled
from fixtures.export_c import write_sources
from fixtures.programs import path_of, tried

pytestmark = pytest.mark.slow

STRICT = (
    "-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wfloat-equal", "-Wundef",
    "-pedantic", "-Werror",
)  # fmt: skip
METHODS = ("joint", "states")
STYLES = [*product(("float", "double"), ("one", "two"))]


@pytest.fixture(scope="module")
def switched(plant):
    """The plant with valves that a carrier switches, not on the time grid of the samples, where rounding decides."""
    return plant.replace({"T_pwm": 0.01, "s_pwm": 0.237})


@pytest.fixture(scope="module")
def log(switched, recorded_by):
    """A worn clutch, with the supply pressure, and a position sensor that is exchanged in the middle."""
    worn = switched.replace({n: 1.08 * v for n, v in zip(switched.load.names, switched.load.theta, strict=True)})
    made = recorded_by(worn, driven=1)
    supply = np.full(len(made), 9.4e5) + 2e3 * np.random.default_rng(2).standard_normal(len(made))
    position = made["position"] + 4e-4 * (made.time > 4.0)
    duties = {name: np.round(made[name], 4) for name in ("duty_supply", "duty_exhaust")}
    return made.without("pressure_a").with_columns(position=position, pressure_supply=supply, **duties)


@pytest.fixture(scope="module")
def faulty(log):
    """The recording with missing, frozen, impossible and late samples, spikes, missing duty cycles, and a long hole."""
    values = log["position"]
    made = spoiled(log, "position", slice(600, 640))
    made = spoiled(made, "position", slice(1500, 1540), values[1500])
    made = spoiled(made, "position", slice(2200, 2203), values[2200] + 6e-3)
    below = np.interp(np.arange(100), [0, 40, 59, 99], [values[3300], -1.2e-3, -1.2e-3, values[3400]])
    made = spoiled(made, "position", slice(3300, 3400), below)
    made = spoiled(made, "duty_supply", slice(2700, 2702))
    made = spoiled(made, "duty_exhaust", 5100)
    torn = picked(made, np.r_[0:1800, 1803:4500, 4530 : len(made)])
    return replace(torn, time=torn.time + 70.0 * (torn.time > 4.5))  # in which the sensor was exchanged


@pytest.fixture(scope="module")
def observer_of(switched, log):
    """The observer of a method, with all that a calibration can tell it."""
    conditions = RecordedConditions(temperature=290.0, supply=9.5e5, supply_estimated=switched.value("P_S"))
    weights = switched.load.names
    errors = PositionOnlyErrors(((),), weights, np.full((1, len(weights)), 20.0), np.zeros(1))
    calibration = Calibration(
        (), np.zeros((0, 0)), conditions=conditions, nis=0.05, rest=vented_rest(log.slice(0, 4000)),
        travel=Travel(0.9 * log.reach()), position_only=errors,
    )  # fmt: skip
    return cache(lambda method: observer(switched, method, calibration=calibration))


@pytest.fixture(scope="module")
def found_by(observer_of, tmp_path_factory):
    """What C finds in a recording, and how far it is from Python: found_by(method, style, log)."""
    cc = path_of("cc")

    def program(method, style, state, begins):
        modules = observer_c99(observer_of(method), state, style, "test")
        return replay_program(observer_of(method), modules, style, begins, cc, tmp_path_factory.mktemp("c"))

    @cache
    def calibrated(method, style, begins):
        return program(method, style, begun(observer_of(method), start(observer_of(method))), begins)

    def found(method, style, log, saved=None):
        estimator, begins = observer_of(method), begins_us(log)
        state = begun(estimator, saved or start(estimator))
        made = program(method, style, state, begins) if saved else calibrated(method, style, begins)
        outputs = replayed(made, estimator, log)
        return outputs, parity(estimator, state, log, outputs)

    return found


@pytest.mark.parametrize("method", METHODS)
def test_in_double_everything_is_alike_up_to_rounding(found_by, faulty, method):
    outputs, compared = found_by(method, CStyle(real="double"), faulty)
    assert compared.flags == {}
    assert compared.holds(CStyle(real="double"))
    assert max(d.value for d in compared.differences if d.unit == "m") < 1e-9
    assert max(d.value for d in compared.differences if d.unit == "N") < 1e-5, "the band of the load"
    seen = {name: int(count) for name, count in zip(FLAGS, outputs.health, strict=True) if count}
    assert {"position_missing", "position_frozen", "position_beyond_stops", "duty_missing", "time_missing"} < set(seen)
    assert {"outlier", "rest_moved", "travel_unlike"} < set(seen)
    assert np.nanmax(outputs.outputs[:, RESULT_COLUMNS.index("rest")]) > 3e-4


def test_a_supply_that_is_not_recorded_widens_the_band_of_the_pressure_alike(found_by, observer_of, log):
    alone, estimator = log.without("pressure_supply"), observer_of("joint")
    outputs, compared = found_by("joint", CStyle(real="double"), alone)
    _, samples = observe(estimator, start(estimator), alone)
    deviations = samples.deviations[:, estimator.actuator.states.index("p_A")]
    corrected = np.isfinite(deviations)
    of_c = outputs.outputs[corrected, RESULT_COLUMNS.index("pressure_a_std")]
    assert compared.holds(CStyle(real="double"))
    assert of_c == pytest.approx(deviations[corrected], rel=1e-6)


def test_in_float_the_load_is_that_of_double_also_with_faults(found_by, log, faulty):
    _, compared = found_by("joint", CStyle(), log)
    assert compared.holds(CStyle()), compared
    _, compared = found_by("joint", CStyle(), faulty)
    assert compared.load < 5e-3, "a sample whose flag hangs on a rounding counts"
    assert compared.strokes[0] == compared.strokes[1]


def test_two_rates_have_the_numbers_of_one_also_with_faults(found_by, faulty):
    for real in ("double", "float"):
        (single, compared), (two, _) = (
            found_by("joint", CStyle(real=real, rates=rates), faulty) for rates in ("one", "two")
        )
        # trust and its reasons are judged by the flags so far, when a correction goes on
        same = [i for i, name in enumerate(RESULT_COLUMNS) if name not in ("trust", "reasons")]
        np.testing.assert_array_equal(single.outputs[:, same], two.outputs[:, same])
        for alike, other in zip(single[1:], two[1:], strict=True):
            np.testing.assert_array_equal(alike, other)
        assert compared.strokes[0] == compared.strokes[1] > 2


@pytest.mark.parametrize("kelvin", [250.0, 291.0])
@pytest.mark.parametrize("method", METHODS)
def test_at_another_temperature_of_the_air_everything_is_alike(found_by, log, method, kelvin):
    outputs, compared = found_by(
        method, CStyle(real="double"), log.with_columns(temperature_ambient=np.full(len(log), kelvin))
    )
    assert compared.holds(CStyle(real="double")), compared
    usual, _ = found_by(method, CStyle(real="double"), log)
    as_usual = np.array_equal(outputs.outputs[:, 0], usual.outputs[:, 0], equal_nan=True)
    assert as_usual == (kelvin == 291.0), "within a sensor's error it is that of the calibration"
    width, wider = (results.load[1:, 2] - results.load[1:, 1] for results in (outputs, usual))
    assert not as_usual or np.all(width < wider), "a temperature that is known is less uncertain"


def test_a_temperature_that_is_refused_or_lost_is_flagged_alike(found_by, log):
    """As of a slow channel with another value from 2 to 3 s, that ends at 5 s, 70 s before the next sample."""
    late = replace(log, time=log.time + 70.0 * (log.time > 5.0))
    air = np.where((late.time > 2.0) & (late.time < 3.0), 233.0, 280.0 + late.time / 4.0)
    air[late.time > 5.0] = np.nan
    air[np.arange(len(air)) % 100 != 0] = np.nan
    outputs, compared = found_by("joint", CStyle(real="double"), late.with_columns(temperature_ambient=air))
    assert compared.holds(CStyle(real="double")), compared
    assert next(d.value for d in compared.differences if d.name == "load and band") < 1e-3
    counts = dict(zip(FLAGS, outputs.health.tolist(), strict=True))
    assert (counts["air_refused"], counts["air_lost"]) == (900.0, (late.time > 70.0).sum())
    assert counts["not_learning"] > 0


@pytest.mark.parametrize("every", [1, 7, 1000])
def test_a_temperature_after_a_hole_is_judged_by_the_time_since_the_last_one(found_by, log, every):
    """Air may warm up by 31 K in a hole of 130 s; of a channel that sends one in each sample, or rarely."""
    time = log.time + 130.0 * (log.time > 5.0)
    time[6002:7000:10] = time[6001:7000:10] + 5e-5  # samples that repeat others give one, too
    begins = int(np.argmax(log.time > 5.0))
    sent = np.concatenate([np.arange(begins), np.arange(len(log) - begins)]) % every == 0
    air = np.where(sent, np.where(log.time > 5.0, 300.0, 285.0), np.nan)
    outputs, compared = found_by(
        "joint", CStyle(real="double"), replace(log, time=time).with_columns(temperature_ambient=air)
    )
    assert compared.holds(CStyle(real="double")), compared
    counts = dict(zip(FLAGS, outputs.health.tolist(), strict=True))
    assert counts["air_refused"] == 0
    assert counts["repeated"] > 0


def test_samples_that_repeat_others_have_that_flag_only(found_by, log):
    """Where the rest has moved, too."""
    moved = log.with_columns(position=log["position"] + 4e-4)
    time = moved.time.copy()
    time[6000:7000:10] = time[5999:6999:10] + 5e-5
    outputs, compared = found_by("joint", CStyle(real="double"), replace(moved, time=time))
    assert compared.flags == {}
    counts = dict(zip(FLAGS, outputs.health.tolist(), strict=True))
    assert counts["repeated"] == 100
    assert counts["rest_moved"] > 1000


def test_strokes_count_from_the_vented_rest_wherever_the_sensor_reads_it(found_by, log):
    far = log.with_columns(position=log["position"] + 1.8e-3)
    _, compared = found_by("joint", CStyle(real="double"), far)
    assert compared.holds(CStyle(real="double")), compared
    assert compared.strokes[0] == compared.strokes[1] > 2


def test_a_filter_that_diverges_goes_back_to_the_last_stroke_and_starts_anew(found_by, log):
    # the position stays far from what the duty cycles say
    driven = spoiled(log, "duty_supply", slice(3000, 3300), 1.0)
    wild = spoiled(driven, "position", slice(3000, 3300), np.linspace(2e-2, 0.0, 300))
    outputs, compared = found_by("joint", CStyle(real="double"), wild)
    assert compared.flags == {}
    assert outputs.health[list(FLAGS).index("contradiction")] > 0
    assert compared.theta < 1e-6


def test_the_model_and_the_paper_s_load_are_exported_too(found_by, plant, recorded_by):
    actuator = Actuator(plant.parameters, Load((9.0e5, -0.3e5, 0.6e5)), "isothermal")
    estimator, log = observer(actuator, "paper"), recorded_by(actuator, driven=1)
    state, style = start(estimator), CStyle(real="double")
    outputs = replay(estimator, observer_c99(estimator, state, style, "test"), style, log, path_of("cc"))
    compared = parity(estimator, state, log, outputs)
    assert compared.holds(style), compared


@pytest.mark.parametrize("case", ["as before", "moves later", "moved before", "moved at last", "jumped"])
def test_an_export_goes_on_from_what_a_saved_state_has_learnt(found_by, observer_of, log, faulty, case):
    """Also where the zero moves, which sends both back to the calibration, and with the zero that was known last."""
    moved = log.with_columns(position=log["position"] + 4e-4)
    jumping = spoiled(log, "position", slice(2500, 4000), log["position"][2500:4000] + 5e-3)
    learnt_from, followed = {
        "as before": (log, log),
        "moves later": (log.slice(0, 4000), faulty),
        "moved before": (moved, moved),
        "moved at last": (faulty, log),
        "jumped": (jumping.slice(0, 4000), log),
    }[case]
    estimator = observer_of("joint")
    saved, _ = observe(estimator, start(estimator), learnt_from)
    assert (abs(saved.zero) > 3e-4) == case.startswith("moved")
    assert bool(saved.unzeroed) == (case == "jumped")
    outputs, compared = found_by("joint", CStyle(real="double"), followed, saved)
    assert compared.holds(CStyle(real="double")), compared
    assert compared.strokes[0] > saved.strokes > 0
    first_flags = outputs.outputs[100, RESULT_COLUMNS.index("flags")]
    assert bool(int(first_flags) >> list(FLAGS).index("zero_unknown") & 1) == (case == "jumped")


def test_a_resumed_export_whose_zero_moves_has_the_numbers_of_one_that_begins_as_calibrated(observer_of, found_by, log):
    """Once the rest has shown it: what was learnt before, with whatever zero, is forgotten."""
    estimator, moved = observer_of("joint"), log.with_columns(position=log["position"] + 4e-4)
    saved, _ = observe(estimator, start(estimator), log)
    resumed, new = (found_by("joint", CStyle(real="double"), moved, state)[0] for state in (saved, None))
    assert saved.theta.any()
    assert np.nanmax(resumed.outputs[:, RESULT_COLUMNS.index("rest")]) > 3e-4
    np.testing.assert_allclose(resumed.theta, new.theta, rtol=0, atol=1e-9)


MEMORY = """
#include <stdio.h>
#include <string.h>
#include "clutch.h"
static clutch_t self;
static clutch_nvram_t stored[2];
static void run(void)
{
    double sample[6];
    clutch_output_t output;
    while (fread(sample, sizeof(sample), 1u, stdin) == 1u) {
        const clutch_input_t input = { sample[0], sample[1], sample[2], sample[3] };
        clutch_fast(&clutch_data, &self, &input, (uint32_t)sample[5], &output);
    }
}
int main(int count, char **words)
{
    clutch_band_t band;
    clutch_start(&clutch_data, &self, NULL, 0u);
    run();
    clutch_load(&clutch_data, &self, 6e-3, &band);
    printf("%.17g %u %zu\\n", band.force, (unsigned)self.strokes, sizeof(stored[0]));
    clutch_store(&clutch_data, &self, stored);
    if (count > 1) { ((unsigned char *)stored)[atoi(words[1])] ^= 1u; }
    (void)memset(&self, 7, sizeof(self));
    clutch_start(&clutch_data, &self, &stored[0], 0u);
    clutch_load(&clutch_data, &self, 6e-3, &band);
    printf("%.17g %u\\n", band.force, (unsigned)self.strokes);
    return 0;
}
"""


def test_a_restart_goes_on_from_memory_and_a_damaged_one_from_the_calibration(observer_of, log, tmp_path):
    estimator, folder = observer_of("joint"), tmp_path / "src"
    write_sources(estimator, CStyle(real="double"), folder)
    (folder / "main.c").write_text("#include <stdlib.h>\n" + MEMORY)
    program = tmp_path / "main"
    subprocess.run([path_of("cc"), "-O0", "-o", program, *folder.glob("*.c"), "-lm"], check=True)
    data = samples_of(log.slice(0, 5000)).tobytes()

    def run(*words):
        lines = subprocess.run([program, *words], input=data, capture_output=True, check=True).stdout.split()
        return [float(word) for word in lines]

    force, strokes, size, again, strokes_again = run()
    calibrated = float(estimator.actuator.load.force(np.array([6e-3]))[0])
    assert abs(again - force) < 0.25 * abs(force - calibrated)
    assert strokes_again == strokes > 0
    for at in (0, 4, 8, 12, int(size) - 9, int(size) // 2):
        *_, again, strokes_again = run(str(at))
        assert (again, strokes_again) == (pytest.approx(calibrated), 0.0), at


@pytest.mark.parametrize(
    ("method", "real", "rates"),
    [*(("joint", *style) for style in STYLES), ("states", *STYLES[3])],
)
def test_it_compiles_without_a_warning_and_float_knows_no_double(observer_of, tmp_path, method, real, rates):
    estimator = observer_of(method)
    modules = observer_c99(estimator, start(estimator), CStyle("own_name", real, rates), "test")
    for file, text in source_files(modules).items():
        (tmp_path / file).write_text(text)
    sources = sorted(tmp_path.glob("*.c"))
    if clang := tried("clang").path:  # its warnings do not hang on what it optimises
        subprocess.run([clang, *STRICT, "-fsyntax-only", *sources], cwd=tmp_path, check=True)
    subprocess.run([path_of("cc"), *STRICT, "-c", *sources], cwd=tmp_path, check=True)
    symbols = subprocess.run(
        [path_of("nm"), "-g", *sorted(tmp_path.glob("*.o"))], capture_output=True, text=True, check=True
    )
    defined = {line.split()[-1] for line in symbols.stdout.splitlines() if line.split()[-2:-1] in (["T"], ["R"], ["D"])}
    assert all(name.startswith("own_name") for name in defined)
    written = subprocess.run(
        [path_of("nm"), *sorted(tmp_path.glob("*.o"))], capture_output=True, text=True, check=True
    ).stdout
    assert not [line for line in written.splitlines() if line.split()[-2:-1] in (["b"], ["B"], ["d"], ["C"])]
    if real == "float":
        assert not any(
            word in code.header + code.source for code in modules.values() for word in ("double ", "(double")
        )


def test_a_name_that_c_does_not_take_is_a_sentence():
    for name in ("2nd", "a b", "", "int", "x" * 40):
        with pytest.raises(ParameterError, match="not a C identifier"):
            CStyle(name)


def test_a_title_cannot_end_the_comment_that_it_stands_in(switched):
    estimator = observer(switched, "states")
    code = observer_c99(estimator, start(estimator), CStyle(), "cal */ int spoiled; /*.toml")["clutch"]
    assert "*/ int spoiled" not in code.header
    assert "cal * / int spoiled; / *.toml" in code.header


def test_numbers_are_literals_of_their_type():
    double, single = c_number("double"), c_number("float")
    assert [double(x) for x in (1, 0.1, np.inf, -np.inf, np.nan)] == [
        "1.0",
        "0.1",
        "HUGE_VAL",
        "-HUGE_VAL",
        "(double)NAN",
    ]
    assert [single(x) for x in (1, 0.1, 1e-30, 16777217)] == ["1.0F", "0.100000001F", "1e-30F", "16777216.0F"]
    assert ctypes.c_float(float(single(np.pi)[:-1])).value == np.float32(np.pi)


def test_the_drive_of_an_export_without_a_recording_has_strokes(observer_of):
    drive = trial_drive(observer_of("joint"))
    assert replace(drive).time[-1] == pytest.approx(4.0, abs=2e-3)
    assert np.nanmax(drive["position"]) > 8e-3
    assert abs(drive["position"][-1]) < 2e-3
