"""Friction measured on two rigs: a tribometer's LuGre in free run, and a cylinder's Coulomb friction over pressure.

The recordings lie beside the repository with their licences; README.txt there says where they are from.
"""

from pathlib import Path

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.rig import conclusions, coulomb_friction, fit_lugre

AMBIENT = 101_325.0


def folder_of(shared: Path, name: str) -> Path:
    folder = shared / "data" / name
    if not folder.is_dir():
        pytest.skip(f"no {shared.name}/data/{name} beside the repository: the rig's recordings are needed.")
    return folder


@pytest.fixture(scope="module")
def tribometer(shared) -> Log:
    """Position and force in SI; the author turns the sign of the friction column."""
    columns = np.loadtxt(folder_of(shared, "reciprocating_friction") / "test_data_2.txt", skiprows=1)
    return Log(columns[:, 0], {"position": 1e-3 * columns[:, 2], "force": -1e-6 * columns[:, 3]}, "test_data_2")


@pytest.fixture(scope="module")
def cylinder(shared) -> list[Log]:
    """The cylinder with the round seal, a recording for each held pressure."""
    logs = []
    for bar in (1, 3, 5, 7):
        path = folder_of(shared, "zillen_cylinder_friction") / "friction" / f"Circle_{bar}bar.csv"
        columns = np.loadtxt(path)
        measured = {
            "position": 1e-3 * columns[:, 4],
            "force": columns[:, 6],
            "pressure_a": AMBIENT + 1e5 * columns[:, 5],
        }
        logs.append(Log(1e-3 * columns[:, 0], measured, path.stem, {"ambient_Pa": repr(AMBIENT)}))
    return logs


def window(log: Log, start: float, seconds: float = 20.0) -> Log:
    return log.slice(*np.searchsorted(log.time, [start, start + seconds]))


# the load is put on and the first, other stroke made in the first 12 s, and taken off after 205 s
@pytest.mark.slow
@pytest.mark.parametrize("start", range(12, 185, 20))
def test_the_papers_lugre_fits_the_tribometer_to_88_percent_over_any_20_s_in_free_run(tribometer, start):
    assert fit_lugre(window(tribometer, start)).fit_percent >= 88.0


def test_friction_of_one_20_s_predicts_the_rest_of_the_tribometer_record_to_88_percent(tribometer):
    friction = fit_lugre(window(tribometer, 12.0))
    fixed = {name: value for name, value in friction.values.items() if name != "force_zero"}
    assert fit_lugre(window(tribometer, 32.0, 170.0), fixed=fixed).fit_percent >= 88.0


def test_the_tribometer_has_the_friction_that_was_found_independently(tribometer):
    parameters = fit_lugre(window(tribometer, 12.0)).parameters
    # README.txt of the data: 2.80 N, 33.9 N/mm, 0.48 N s/mm, D_zdot held at 0
    for name, value in {"F_C": 2.80, "K_z": 33.9e3, "D_v": 480.0}.items():
        assert parameters[name].low <= value <= parameters[name].high
    assert parameters["D_zdot"].value == 0.0


def test_the_cylinders_friction_grows_with_pressure_and_a_constant_is_called_inadequate(cylinder):
    friction = coulomb_friction(cylinder)
    frictions = [level.friction.value for level in friction.levels]
    # README.txt of the data: 4.0 N at 1 bar, 7.9 N at 7 bar
    assert friction.levels[0].friction.low <= 4.0 <= friction.levels[0].friction.high
    assert friction.levels[3].friction.low <= 7.9 <= friction.levels[3].friction.high
    assert frictions == sorted(frictions)
    assert friction.test.p_value < 1e-6
    assert friction.slope.low > 0.0
    sentence = conclusions(friction)[0]
    assert "a constant F_C is inadequate" in sentence
    assert "energy-balance-stribeck" in sentence


def test_the_area_of_the_cylinder_comes_out_of_the_forces(cylinder):
    area = coulomb_friction(cylinder).area
    # 25 mm bore
    assert area.low <= np.pi / 4 * 0.025**2 <= area.high


def test_running_in_and_the_speeds_of_the_machine_are_reported(cylinder):
    friction = coulomb_friction(cylinder)
    text = "\n".join(conclusions(friction)[1:])
    assert friction.levels[3].drifts
    assert "drifts between 7.19 and 8.37 N over its 9 cycles" in text
    assert "the speed out differs between levels, 5.4 to 10.0 mm/s" in text
