"""Effects of the readings of the paper that run, recomputed plainly."""

import numpy as np
import pytest

from clutchid import fit
from clutchid.model import Actuator, Load
from clutchid.study.tables import TABLE_1
from fixtures.commands import called

pytestmark = pytest.mark.slow


def test_the_slope_of_phi_2_changes_weights_load_and_position_as_two_fits_do(study, logs):
    row = study.tables["as_printed"].rows[0]
    published, stated = fit(logs[0], Actuator(load=Load(phi2_slope=0.001))), fit(logs[0])
    theta, other = (np.array(result.actuator.load.theta) for result in (published, stated))
    np.testing.assert_allclose(row[3:6], theta / other - 1, rtol=1e-9)
    y = np.linspace(0, logs[0]["position"].max(), 2001)
    largest = np.abs(published.actuator.load.force(y) - stated.actuator.load.force(y)).max()
    assert row[6] == pytest.approx(largest, rel=1e-3)  # 401 positions
    runs = [next(iter(result.recordings.values())) for result in (published, stated)]
    assert row[7] == np.abs(runs[0].simulated["position"] - runs[1].simulated["position"]).max()
    assert row[8:] == tuple(getattr(run.errors, f"{name}_rms") for name in ("position", "pressure_a") for run in runs)


def test_both_meanings_of_n_and_of_a_reset_are_compared_as_in_table_1(study):
    table, p, q = (study.tables[stem] for stem in ("as_printed", "table_1", "table_1_carry_q"))
    changes = dict(zip(table.column("subject"), table.column("theta_1_change"), strict=True))
    for i, n in enumerate((2, 4, 8, 16, 32), 1):
        parts, every, mass = (t.column("theta_1")[row] for t, row in ((p, i), (p, i + 5), (q, i + 5)))
        assert changes[f"N = {n}"] == pytest.approx(every / parts - 1)
        assert changes[f"reset, N = {n}"] == pytest.approx(mass / every - 1)


def test_a_printed_weight_in_the_other_basis_is_worth_3_25_mm_less_of_phi_2(study):
    table = study.tables["as_printed_table_1"]
    expected = [-theta[1] * 3.25e-3 * 0.999 for theta in TABLE_1.values()]
    assert table.column("load_difference") == pytest.approx(expected, rel=1e-9)
    assert (min(expected), max(expected)) == pytest.approx((55, 189), abs=0.6)  # the errata
    assert table.column("peak_published") == pytest.approx([8.5e-3] * 6, abs=1e-5)
    assert max(table.column("peak_stated")) < 8.4e-3
    assert min(table.column("position_difference")) > 0.5e-3


def test_static_pressure_of_eq_26_has_the_errors_of_the_table_of_pressures(study):
    last = study.tables["as_printed"].rows[-1]
    errors = study.tables["pressure_errors"]
    assert last[-2:] == tuple(errors.column(f"first_{way}_measured")[0] for way in ("static", "balanced"))


def test_the_command_adds_the_paper_as_printed_with_an_option(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("clutchid.study.paper_study", lambda *_, literal: asked.append(literal))
    assert [called("paper", "--out", tmp_path, *options) for options in ([], ["--literal"])] == [0, 0]
    assert asked == [False, True]
