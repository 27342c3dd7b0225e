"""Random sequences of what a control unit may be given, and hours of strokes, with sanitizers."""

import os
import subprocess

import numpy as np
import pytest

from clutchid.exports.c99 import CStyle
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.observer import observer
from fixtures.export_c import compiled, write_sources

pytestmark = [
    pytest.mark.slow,
    pytest.mark.needs("cc with sanitizers"),
]

#: Samples of a random sequence, and hours of strokes, whose microseconds wrap after 1.2: `.ci/slow` takes more of both.
SAMPLES = int(os.environ.get("CLUTCHID_HOSTILE_SAMPLES", "20000"))
HOURS = float(os.environ.get("CLUTCHID_HOSTILE_HOURS", "0.02"))

HOSTILE = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "clutch.h"
static clutch_t self;
static uint32_t state = 1u;
static uint32_t draw(void) { state = (state * 1664525u) + 1013904223u; return state >> 8; }
static clutch_number_t any(clutch_number_t sound)
{
    static const double wild[] = { 0.0, -0.0, 1.0001, -1e-4, 1.5, -3e34, 3e34, 1e-40, 5e6, 65.535e-3, 1e300 };
    const uint32_t kind = draw() % 400u;
    if (kind == 0u) { return (clutch_number_t)NAN; }
    if (kind == 1u) { return (clutch_number_t)INFINITY; }
    if (kind == 2u) { return (clutch_number_t)wild[draw() % (sizeof(wild) / sizeof(wild[0]))]; }
    return sound;
}
static int sound_number(clutch_number_t value) { return isnan(value) || isfinite(value); }
int main(int count, char **words)
{
    const long samples = atol(words[1]);
    const int wild = atoi(words[2]);
    static double recorded[8000][3];
    FILE *file = fopen(words[3], "rb");
    const long length = (long)fread(recorded, sizeof(recorded[0]), sizeof(recorded) / sizeof(recorded[0]), file);
    long bad = 0;
    clutch_band_t band;
    (void)count;
    fclose(file);
    clutch_start(&clutch_data, &self, NULL, 0u);
    for (long i = 0; i < samples; i++) {
        const double *row = recorded[i % length];
        clutch_input_t input = { (clutch_number_t)row[0], (clutch_number_t)row[1], (clutch_number_t)row[2],
            (clutch_number_t)9e5 };
        uint32_t dt = 1000u;
        clutch_output_t output;
        if (wild) {
            input.position = any(input.position);
            input.duty_supply = any(input.duty_supply);
            input.duty_exhaust = any(input.duty_exhaust);
            input.supply_pressure = any(input.supply_pressure);
            if ((draw() % 200u) == 0u) {
                static const uint32_t steps[] = { 0u, 1u, 99u, 100u, 1501u, 5000u, 5001u, 21000u, 21001u, 1000000u,
                    4294967295u };
                dt = steps[draw() % (sizeof(steps) / sizeof(steps[0]))];
            }
        }
        clutch_fast(&clutch_data, &self, &input, dt, &output);
        if ((draw() % 3u) != 0u) { (void)clutch_slow(&clutch_data, &self); }
        clutch_load(&clutch_data, &self, (clutch_number_t)6e-3, &band);
        bad += !(isfinite(band.force) && (band.low <= band.force) && (band.force <= band.high));
        bad += !(sound_number(output.pressure_a) && sound_number(output.position));
        bad += !sound_number(output.pressure_a_std);
    }
    printf("%ld %u %.9g %.9g %.9g\\n", bad, (unsigned)self.strokes, band.low, band.force, band.high);
    return 0;
}
"""


@pytest.fixture(scope="module")
def estimator(plant):
    conditions = RecordedConditions(supply=9e5, supply_estimated=plant.value("P_S"))
    return observer(plant, calibration=Calibration((), np.zeros((0, 0)), conditions=conditions, nis=0.05))


@pytest.fixture(scope="module")
def strokes(drive_log):
    """Position and duty cycles from a vented rest to the last one, so that they can follow themselves."""
    rests = np.flatnonzero((drive_log["position"] < 2e-4) & (drive_log["duty_supply"] < 1e-3))
    columns = [drive_log[name][: rests[-1] + 1] for name in ("position", "duty_supply", "duty_exhaust")]
    return np.column_stack(columns)


@pytest.mark.parametrize("rates", ["one", "two"])
@pytest.mark.parametrize("real", ["float", "double"])
def test_a_million_samples_of_anything_leave_a_finite_load(estimator, strokes, tmp_path, real, rates):
    bad, *_ = run(estimator, CStyle(real=real, rates=rates), tmp_path, strokes, SAMPLES, wild=True)
    assert bad == 0


def test_hours_of_strokes_through_the_wrap_of_the_microseconds_end_at_the_load(estimator, plant, strokes, tmp_path):
    samples = round(HOURS * 3.6e6)
    bad, ended, low, force, high = run(estimator, CStyle(), tmp_path, strokes, samples, wild=False)
    true = plant.load.force(6e-3)
    assert bad == 0
    assert ended == pytest.approx(2.0 * samples / len(strokes), abs=2.0)
    assert low < true < high
    assert force == pytest.approx(true, rel=0.01)


def run(estimator, style, folder, strokes, samples, *, wild):
    """Samples with a load that is none, strokes, and the load at 6 mm with its band after so many samples."""
    sources = write_sources(estimator, style, folder / "src")
    (folder / "main.c").write_text(HOSTILE)
    strokes.astype(np.float64).tofile(folder / "strokes")
    options = (
        "-I", str(folder / "src"), f"-Dclutch_number_t={style.real}", "-fsanitize=undefined,address",
        "-fno-sanitize-recover=all",
    )  # fmt: skip
    program = compiled([folder / "main.c", *sources], folder / "main", *options)
    arguments = [program, str(samples), str(int(wild)), str(folder / "strokes")]
    words = subprocess.run(arguments, capture_output=True, check=True, text=True).stdout.split()
    return [float(word) for word in words]
