"""The numbers in the tables of the study, recomputed plainly."""

import re

import numpy as np
import pytest

from clutchid.model import Load
from clutchid.simulation import Partition, simulate
from clutchid.study.bundled import TrueLoad, true_load
from clutchid.study.results import NUMBERS, PaperMethod, best_possible, load_error, methods
from clutchid.study.tables import TABLE_1, TABLE_2, computed, equation_21, printed

pytestmark = pytest.mark.slow

SHARES = (2, 4, 8, 16, 32)
LABELS = ("ballistic", *(f"{n} parts" for n in SHARES), *(f"every {n} samples" for n in SHARES))


def case_of(study, method):
    return next(case for case in study.cases if case.method == method)


def test_all_readings_of_all_numbers_are_done_for_both_p_and_q():
    assert len(set(methods())) == 1 + 2 * 2 * len(NUMBERS)
    assert methods()[0].partition is None
    assert PaperMethod("parts", 4, "q").partition == Partition(parts=4, carry="q")
    assert PaperMethod("every", 4).partition == Partition(every=4, carry="p")


@pytest.mark.parametrize("stem", ["table_1", "table_1_carry_q", "table_2", "table_2_carry_q", "pressure_errors"])
def test_tables_have_a_row_for_every_method_in_the_order_of_the_paper(study, stem):
    assert study.tables[stem].column("method") == LABELS


def test_table_1_holds_the_estimates_and_the_bounds_are_kept(study):
    for stem in ("table_1", "table_1_carry_q"):
        table = study.tables[stem]
        assert min(table.column("theta_1")) >= 0
        assert min(table.column("theta_3")) >= 0
    assert study.tables["table_1"].column("theta_2")[0] == study.cases[0].fit.parameters["theta_2"].value
    assert study.tables["table_1"].column("theta_1_std")[0] == study.cases[0].fit.parameters["theta_1"].std


def test_the_printed_numbers_stand_beside_both_readings(study):
    numbers = [None, *NUMBERS, *NUMBERS]
    for stem in ("table_1", "table_1_carry_q"):
        for i in (1, 2, 3):
            assert study.tables[stem].column(f"theta_{i}_printed") == tuple(TABLE_1[n][i - 1] for n in numbers)
    for stem in ("table_2", "table_2_carry_q"):
        assert study.tables[stem].column("printed_position") == tuple(TABLE_2[n][0] for n in numbers)
        assert study.tables[stem].column("printed_pressure_a") == tuple(TABLE_2[n][1] for n in numbers)


UNITS = {"mm": 1e-3, "bar": 1e5, "N": 1.0, "%": 0.01, "10⁻⁴ m²": 1e-4, "10¹² Pa²": 1e12, "10⁵ N/m": 1e5, "10⁻⁶": 1e-6}


def test_people_see_numbers_in_the_unit_of_the_heading(study):
    seen = set()
    for table in study.tables.values():
        for column in table.columns:
            for unit in re.findall(r"\[(.+?)\]", f"{column.heading} {column.group}"):
                assert column.scale == UNITS[unit], column
                seen.add(unit)
    assert seen == set(UNITS)


@pytest.mark.parametrize(
    "method", [PaperMethod("ballistic"), PaperMethod("parts", 8), PaperMethod("every", 16, "q")], ids=str
)
def test_table_2_has_the_sums_of_squares_of_plain_simulations(study, logs, method):
    case = case_of(study, method)
    table = study.tables["table_2" if method.carry == "p" else "table_2_carry_q"]
    row = table.column("method").index(method.label)
    for prefix, partition in (("fitted", method.partition), ("ballistic", None)):
        plain = simulate(case.fit.actuator, logs[0], partition=partition).log
        for name, unit in (("position", "m2"), ("pressure_a", "Pa2")):
            error = plain[name] - logs[0][name]
            assert table.column(f"{prefix}_{name}_sse [{unit}]")[row] == pytest.approx(error @ error, rel=1e-9)
            assert table.column(f"{prefix}_{name}_rms")[row] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)


def test_no_theta_has_a_smaller_position_error_in_a_ballistic_run_than_the_ballistic_one(study):
    for stem in ("table_2", "table_2_carry_q"):
        errors = study.tables[stem].column("ballistic_position_sse")
        assert errors[0] == min(errors)


def test_dense_resets_hide_the_error_of_the_model(study):
    table = study.tables["table_2"]
    every_2 = table.column("method").index("every 2 samples")
    assert table.column("fitted_position_rms")[every_2] < 1e-4
    assert table.column("ballistic_position_rms")[every_2] > 1e-3


def test_carrying_the_masses_of_air_brings_the_load_of_dense_resets_nearer_to_the_truth(study, logs):
    truth = true_load(logs[0])
    for n in NUMBERS:
        p, q = (load_error(case_of(study, PaperMethod("every", n, carry)), truth) for carry in ("p", "q"))
        assert q.engaging < p.engaging
        assert q.everywhere < p.everywhere


def test_verification_has_every_case_and_its_errors_on_the_second_half(study, logs):
    table = study.tables["verification"]
    assert len(table.rows) == 21
    assert table.column("carry")[:2] == ("–", "p")
    for case, rms in zip(study.cases, table.column("position_rms"), strict=True):
        error = case.verified.simulated["position"] - logs[1]["position"]
        assert rms == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)


def test_the_load_error_is_the_rms_distance_from_the_true_load(study, logs):
    truth, table = true_load(logs[0]), study.tables["verification"]
    error = study.cases[0].fit.actuator.load.force(truth.position) - truth.force
    seven = [i for i, y in enumerate(truth.position) if 4.9e-3 < y < 8.1e-3]
    assert len(seven) == 7
    everywhere, engaging = (np.sqrt(np.mean(part**2)) for part in (error, error[seven]))
    expected = {
        "load_rms": everywhere,
        "load_rms_of_peak": everywhere / truth.force.max(),
        "load_rms_engaging": engaging,
    }
    assert {name: table.column(name)[0] for name in expected} == pytest.approx(expected)


def test_the_best_possible_load_bounds_every_estimate_from_below(study, logs):
    truth = true_load(logs[0])
    assert best_possible(truth) <= min(load_error(case, truth).everywhere for case in study.cases)


def test_a_load_on_the_splines_is_possible_without_error():
    y = np.linspace(5e-4, 20e-3, 40)
    assert best_possible(TrueLoad(y, Load((9e5, -4e4, 5e4)).force(y))) < 1e-6


def test_equation_21_agrees_with_the_print_to_its_last_digits_with_the_published_slope():
    # The print has five significant digits, c_3 and g_3 four or fewer: half a unit of the last is at most 3.2e-4.
    table = equation_21()
    differences = [x for x in table.column("relative_difference") if x is not None]
    assert len(differences) == 13
    assert max(abs(x) for x in differences) < 3.2e-4


def test_the_stated_slope_gives_another_xi_2_and_the_same_xi_1_and_xi_3():
    stated, published = computed(1.0), computed(0.001)
    changed = {name for name in stated if stated[name] != published[name]}
    assert changed == {"a_2", "b_2", "c_2", "d_2"}
    assert [stated[name] for name in ("a_2", "b_2", "c_2", "d_2")] == pytest.approx(
        [76.923077, -0.3076923, 3.076923e-4, -5.25e-3], rel=1e-6
    )


def test_the_second_entry_of_the_printed_xi_2_is_two_entries_run_together(study):
    assert printed()["b_2"][0] is None
    assert printed()["c_2"][0] == -3.0769e-7
    assert "one of the two is lost" in study.page.read_text(encoding="utf-8")
