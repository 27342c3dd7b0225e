"""What the checks read from a recording: stretches with one open valve, blur, the grid of the duty cycles, starts."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.preparation.inspection.inspected import InspectedRecording
from clutchid.preparation.inspection.timing import starts
from clutchid.simulation import simulate
from fixtures.changed_logs import spoiled

ACTUATOR = Actuator(load=Load((9e5, -0.3e5, 0.6e5)))


def valves(n: int, *pulses: tuple[str, int, int]) -> dict[str, np.ndarray]:
    """Valves that are fully open from one sample to another, and closed else."""
    duties = {"duty_supply": np.zeros(n), "duty_exhaust": np.zeros(n)}
    for name, begin, end in pulses:
        duties[f"duty_{name}"][begin:end] = 1.0
    return duties


def reading(columns: dict[str, np.ndarray], actuator: Actuator = ACTUATOR) -> InspectedRecording:
    n = next(iter(columns.values())).size
    return InspectedRecording(Log(np.arange(n) / 1000, columns), actuator)


def test_pulses_a_period_of_a_slow_carrier_apart_move_the_piston_together():
    # 50 ms from the last open sample to the next: 20 Hz
    seen = reading(valves(1000, ("supply", 100, 110), ("supply", 159, 170), ("supply", 221, 230)))
    assert [ends.tolist() for ends in seen.open_alone(True)] == [[100, 221], [170, 230]]
    assert [ends.tolist() for ends in seen.open_alone(False)] == [[], []]


def test_pulses_with_the_other_valve_between_them_are_apart():
    seen = reading(valves(1000, ("supply", 100, 110), ("exhaust", 112, 115), ("supply", 120, 130)))
    assert [ends.tolist() for ends in seen.open_alone(True)] == [[100, 120], [110, 130]]
    assert [ends.tolist() for ends in seen.open_alone(False)] == [[112], [115]]


def test_a_stretch_with_both_valves_open_is_none_with_one_alone():
    seen = reading(valves(1000, ("supply", 100, 200), ("exhaust", 150, 300)))
    assert [ends.tolist() for ends in seen.open_alone(True)] == [[100], [150]]
    assert [ends.tolist() for ends in seen.open_alone(False)] == [[200], [300]]


def test_a_column_seems_to_change_by_six_deviations_of_its_noise_or_two_of_its_steps():
    noise = 3e-5 * np.random.default_rng(0).standard_normal(20_000)
    assert reading({"position": noise}).blur("position") == pytest.approx(6 * 3e-5, rel=0.35)
    slope = np.linspace(0.0, 0.02, 20_000)
    coarse = 1e-4 * np.round(slope / 1e-4)
    assert reading({"position": coarse}).blur("position") == pytest.approx(2e-4, rel=1e-6)


@pytest.mark.parametrize(("level", "expected"), [(1.0, 0.123), (0.4, 0.01)])
def test_valves_that_are_only_opened_and_closed_change_on_a_grid_but_have_no_carrier(level, expected):
    on = np.random.default_rng(0).random(400) < 0.3
    seen = reading({"duty_supply": level * np.repeat(on, 10), "duty_exhaust": np.zeros(4000)})
    assert seen.duty_period > 0.0
    assert (seen.carrier_period or 0.123) == pytest.approx(expected)


def test_valves_that_change_anywhere_have_no_grid():
    on = np.random.default_rng(0).random(4000) < 0.03
    seen = reading({"duty_supply": 0.4 * on, "duty_exhaust": np.zeros(4000)})
    assert seen.duty_period == seen.carrier_period == 0.0


def test_each_wide_start_from_the_rest_is_a_stroke_whose_simulated_motion_is_the_measured_one(strokes):
    starts_of_strokes = starts(InspectedRecording(strokes(), ACTUATOR))
    assert starts_of_strokes.measured.size == 6
    # the same equations from the same rest; a noise of 2 um at 20 mm/s is 0.1 ms, three deviations on either side
    assert starts_of_strokes.measured == pytest.approx(starts_of_strokes.simulated, abs=3e-4)
    assert 0.005 < np.median(starts_of_strokes.simulated) < 0.05


@pytest.mark.parametrize(
    ("name", "begin", "end", "value"),
    [
        ("duty_supply", 3000, 3100, 0.6),  # opens by two thirds
        ("duty_exhaust", 3005, 3100, 1.0),  # lets out what comes in
        ("duty_supply", 2900, 2905, 0.3),  # has let in air a tenth of a second before
        ("position", 2700, 3000, 4e-3),  # stands off its rest
        ("position", 2700, 3000, np.nan),
    ],
    ids=["narrow", "vented", "again", "off the rest", "missing"],
)
def test_a_start_that_tells_no_time_is_left_out(strokes, name, begin, end, value):
    log = strokes()
    # the position keeps its noise
    changed = log[name][begin:end] + value if name == "position" else value
    log = spoiled(log, name, slice(begin, end), changed)
    assert starts(InspectedRecording(log, ACTUATOR)).measured.size == 5


@pytest.mark.parametrize(("still", "grade"), [(3, "good"), (4, "bad")])
def test_where_most_strokes_show_no_motion_the_channels_do_not_belong_together(strokes, check_of, still, grade):
    log = strokes()
    end = 1000 * (still + 1)
    noise = 2e-6 * np.random.default_rng(1).standard_normal(end)
    seen = check_of(spoiled(log, "position", slice(end), noise), "time shift", ACTUATOR)
    assert seen.grade == grade
    assert ("no motion in 4 of 6" in seen.value) == (grade == "bad")


@pytest.fixture(scope="module")
def strokes():
    """Six times the same stroke from a vented rest, from 1 s on: 0.1 s supply, then the exhaust; 2 um of noise."""

    def make() -> Log:
        t = np.arange(1000) / 1000
        once = {"duty_supply": 1.0 * (t < 0.1), "duty_exhaust": 1.0 * ((t > 0.15) & (t < 0.7))}
        course = simulate(ACTUATOR, Log(t, once, "stroke")).log["position"]
        course = course * np.interp(t, [0.6, 0.7], [1.0, 0.0])  # the seals' deflection goes to nothing
        columns = {name: np.concatenate([np.zeros(1000), np.tile(v, 6)]) for name, v in once.items()}
        position = np.concatenate([np.zeros(1000), np.tile(course, 6)])
        position += 2e-6 * np.random.default_rng(0).standard_normal(position.size)
        return Log(np.arange(7000) / 1000, {**columns, "position": position}, "strokes")

    return make
