"""Several calibrations in one program, a calibration that changes while it runs, and states that belong to another."""

import subprocess

import numpy as np
import pytest

from clutchid.exports.c99 import CStyle, observer_c99
from clutchid.exports.outputs import OUTPUTS
from clutchid.exports.parity import samples_of
from clutchid.observer import observer, start
from fixtures.export_c import compiled, replay, write_sources
from fixtures.programs import path_of

pytestmark = [pytest.mark.slow, pytest.mark.needs("cc with sanitizers")]

STYLES = [CStyle(real="float", rates="one"), CStyle(real="double", rates="two")]

PROGRAM = """
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "clutch.h"
extern const clutch_data_t other_data;
static clutch_t self[2];
static clutch_nvram_t stored[2];
static clutch_output_t output;
static void put(double value) { (void)fwrite(&value, sizeof(value), 1u, stdout); }
static void put_output(void)
{
    PUT
}
static int take(const clutch_data_t *data, clutch_t *of)
{
    double sample[6];
    const int read = fread(sample, sizeof(sample), 1u, stdin) == 1u;
    const clutch_input_t input = { sample[0], sample[1], sample[2], sample[3] };
    if (read == 1) {
        clutch_fast(data, of, &input, (uint32_t)sample[5], &output);
        (void)clutch_slow(data, of);
        put_output();
    }
    return read;
}
int main(void)
{
    MAIN
    return 0;
}
"""

BOTH = """
    const clutch_data_t *data[2] = { &clutch_data, &other_data };
    for (int i = 0; i < 2; i++) { if (clutch_start(data[i], &self[i], NULL, 0u) != 1) { return 1; } }
    int i = 0;
    while (take(data[i], &self[i]) == 1) { i = 1 - i; }
"""


@pytest.fixture(scope="module")
def calibrations(plant):
    """Two clutches: the other one has more friction, less area and a stiffer spring."""
    changed = {"F_C": 1.2 * plant.value("F_C"), "A_A": 0.97 * plant.value("A_A")}
    worn = {name: 1.1 * weight for name, weight in zip(plant.load.names, plant.load.theta, strict=True)}
    return [observer(plant), observer(plant.replace(changed | worn))]


@pytest.fixture(scope="module")
def samples(plant, recorded_by):
    log = recorded_by(plant)
    return [samples_of(log.slice(0, 4000)), samples_of(log.slice(2000, 6000))]


def built(calibrations, style, main, folder):
    """A program with the source of the first calibration and the data of both."""
    sources = write_sources(calibrations[0], style, folder / "a")
    other = write_sources(calibrations[1], style, folder / "b")
    data = folder / "b" / "clutch_data.c"
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(sources, other, strict=True) if b != data)
    text = PROGRAM.replace("PUT", " ".join(f"put((double)output.{name});" for name in OUTPUTS))
    (folder / "main.c").write_text(text.replace("MAIN", main))
    options = ("-I", str(folder / "a"), "-fsanitize=undefined,address", "-fno-sanitize-recover=all")
    subprocess.run(
        [path_of("cc"), "-O0", "-DCLUTCH_DATA=other_data", f"-I{folder / 'b'}", "-c", data, "-o", folder / "b.o"],
        check=True,
    )
    return compiled([folder / "main.c", *sources, folder / "b.o"], folder / "main", *options)


def run(program, samples):
    process = subprocess.run([program], input=samples.tobytes(), capture_output=True, check=True)
    return np.frombuffer(process.stdout)


@pytest.mark.parametrize("style", STYLES, ids=lambda style: f"{style.real}-{style.rates}")
def test_two_calibrations_share_the_code_and_have_the_outputs_of_two_exports(calibrations, samples, tmp_path, style):
    outputs = run(built(calibrations, style, BOTH, tmp_path), np.stack(samples, axis=1)).reshape(-1, 2, len(OUTPUTS))
    for i, calibration in enumerate(calibrations):
        program = replay(style, write_sources(calibration, style, tmp_path / f"alone{i}"), np.zeros(1), 0)
        alone = run(program, samples[i])[: len(samples[i]) * len(OUTPUTS)].reshape(-1, len(OUTPUTS))
        np.testing.assert_array_equal(outputs[:, i], alone)
    assert outputs[-1, 0, 8] > 0


REFUSED = """
    clutch_band_t band;
    clutch_data_t foreign = clutch_data;
    foreign.code ^= 1u;
    put((double)clutch_start(&foreign, &self[0], NULL, 0u));
    put((double)clutch_store(&foreign, &self[0], stored));
    put((double)clutch_start(&clutch_data, &self[0], NULL, 0u));
    put((double)clutch_refresh(&other_data, &self[0]));
    put((double)clutch_store(&other_data, &self[0], stored));
    clutch_load(&other_data, &self[0], 6e-3, &band);
    put((double)band.force);
    put((double)clutch_store(&clutch_data, &self[0], stored));
    put((double)(clutch_newest(&other_data, stored) == NULL));
    const clutch_t before = self[0];
    (void)take(&other_data, &self[0]);
    put((double)memcmp(&before, &self[0], sizeof(before)));
"""


def test_a_state_of_another_calibration_is_refused_and_left_as_it_is(calibrations, samples, tmp_path):
    printed = run(built(calibrations, CStyle(), REFUSED, tmp_path), samples[0][:1])
    np.testing.assert_array_equal(printed[:8], [0, 0, 1, 0, 0, np.nan, 1, 1])
    output = dict(zip(OUTPUTS, printed[8:-1], strict=True))
    assert output.pop("flags") == 2.0**31
    assert [output.pop(name) for name in ("trust", "reasons", "strokes")] == [0.0] * 3
    assert np.isnan(list(output.values())).all()
    assert printed[-1] == 0.0


CHANGED = """
    static clutch_data_t ram;
    ram = clutch_data;
    (void)clutch_start(&ram, &self[0], NULL, 0u);
    for (int i = 0; (i < 6000) && (take(&ram, &self[0]) == 1); i++) {
        if (i == AT) {
            const uint32_t strokes = self[0].strokes;
            const char change = getenv("CHANGE")[0];
            CHANGES
            const int without = clutch_store(&ram, &self[0], stored);
            const int known = clutch_refresh(&ram, &self[0]);
            const int with = clutch_store(&ram, &self[0], stored);
            (void)fprintf(stderr, "%u %d %d %d", (unsigned)strokes, without, known, with);
        }
    }
    clutch_band_t band;
    clutch_load(&ram, &self[0], 6e-3, &band);
    put((double)band.force);
"""


@pytest.mark.parametrize("style", STYLES, ids=lambda style: f"{style.real}-{style.rates}")
def test_a_calibration_may_be_changed_while_it_runs(plant, recorded_by, tmp_path, style):
    """A tool writes a parameter that adapts, and one that does not; what was learnt and the motion go on."""
    log = recorded_by(plant, seconds=6.0)
    estimator = observer(plant)
    at = [c.base for c in estimator.joint.coordinates].index("F_C")
    area = estimator.actuator.parameter_names.index("A_A")

    mean = f"ram.filter.parameters[{at}].mean"
    changes = f"""
        if (change == 'm') {{ {mean} *= 1.3F; ram.derived.p[{area}] *= 0.98F; }}
        if (change == 'a') {{ {mean} *= 1.0F; }}
    """
    program = built([estimator, estimator], style, CHANGED.replace("AT", "4000").replace("CHANGES", changes), tmp_path)

    def changed(change):
        process = subprocess.run(
            [program], input=samples_of(log).tobytes(), capture_output=True, check=True, env={"CHANGE": change}
        )
        samples = np.frombuffer(process.stdout)
        return samples[:-1].reshape(-1, len(OUTPUTS)), samples[-1], process.stderr.decode()

    plain, force, said = changed("none")
    assert said.split()[1:] == ["1", "1", "1"]
    assert int(said.split()[0]) > 0
    more, heavier, said = changed("more")
    assert said.split()[1:] == ["0", "1", "1"], "a block in deviations from values that are not known here"
    np.testing.assert_array_equal(more[:4000], plain[:4000])
    taken = np.flatnonzero(more[:, 0] != plain[:, 0])[0]
    assert 4000 < taken <= 4011, "with the next correction"
    assert np.isfinite(more[4000:, 0]).all(), "the motion goes on"
    assert abs(more[4020, 0] - plain[4020, 0]) < 0.05 * plain[4020, 0]
    assert heavier != force
    assert (more[:, 8] == plain[:, 8]).all()
    again, *_ = changed("again")
    np.testing.assert_allclose(again[:, 0], plain[:, 0], rtol=1e-4 if style.real == "float" else 1e-9)


def test_an_export_of_another_kind_has_another_code(plant):
    codes = {
        observer_c99(estimator, start(estimator), style, "a test")["clutch"].source.split("#define CODE ")[1].split()[0]
        for estimator, style in (
            (observer(plant), CStyle()),
            (observer(plant), CStyle(rates="two")),
            (observer(plant, "states"), CStyle()),
            (observer(plant.replace({"T_pwm": 0.01})), CStyle()),
        )
    }
    assert len(codes) == 4
