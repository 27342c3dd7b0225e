"""What a plateau of the pressure behind an open supply valve tells, and which one counts."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator

CHECK = "supply pressure"
STEP = 1e-3
P = Actuator().parameters
#: What passes the open supply valve in Pa m³/s while its flow is choked: rho_0 C p_S R T_0.
CHOKED = P.rho_0 * P.C_vs * P.P_S * P.R * P.T_0
#: Time in s in which that fills chamber A at full stroke with supply pressure.
FILL = P.P_S * (P.V_0A + P.A_A * P.y_max) / CHOKED


def held(seconds: float, pressure: float = 8e5, opening: float = 1.0, growth: float = 0.0, **columns: float) -> Log:
    """The supply valve open from 0.5 s on for so long, with a pressure in Pa that grows by `growth` in Pa/s then."""
    time = np.arange(round((seconds + 1.5) / STEP)) * STEP
    opened = (time > 0.4995) & (time < 0.4995 + seconds)
    level = np.where(time > 0.4995, pressure + growth * np.minimum(time - 0.5, seconds), P.P_0)
    noise = 500.0 * np.random.default_rng(0).standard_normal(time.size)
    duties = {"duty_supply": opening * opened, "duty_exhaust": np.zeros(time.size)}
    others = {name: np.full(time.size, value) for name, value in columns.items()}
    return Log(time, {**duties, "pressure_a": level + noise, **others})


@pytest.mark.parametrize(("beyond", "grade"), [(-0.01, "undetermined"), (0.01, "suspect")])
def test_a_plateau_counts_where_the_whole_chamber_could_have_been_filled_before_its_flat_end(check_of, beyond, grade):
    assert 0.2 < FILL < 0.3
    # the flat end takes 30 ms
    seen = check_of(held(FILL + 0.03 + beyond), CHECK)
    assert seen.grade == grade
    assert ("1 plateau" in seen.value) == (grade == "suspect")


def test_a_plateau_is_the_mean_of_its_flat_end(check_of):
    assert check_of(held(0.5, pressure=8.2e5), CHECK).value == "8.2 bar (1 plateau)"
    assert check_of(held(0.5, pressure=P.P_S), CHECK).grade == "good"
    assert check_of(held(0.5, pressure=0.985 * P.P_S), CHECK).grade == "good"
    assert check_of(held(0.5, pressure=0.975 * P.P_S), CHECK).grade == "suspect"


@pytest.mark.parametrize(("share", "flat"), [(0.04, True), (-0.04, True), (0.06, False), (-0.06, False)])
def test_a_chamber_that_still_takes_more_than_a_trickle_is_not_full(check_of, share, flat):
    # without a position the chamber is as small as it can be
    growth = share * CHOKED / P.V_0A
    assert ("plateau" in check_of(held(0.4, 6e5, growth=growth), CHECK).value) == flat


def test_the_trickle_is_counted_in_the_volume_at_the_measured_position(check_of):
    growth = 0.03 * CHOKED / P.V_0A
    assert "plateau" in check_of(held(0.4, 6e5, growth=growth), CHECK).value
    # at full stroke the chamber takes three times as much for the same rise
    assert (P.V_0A + P.A_A * P.y_max) / P.V_0A > 3
    assert "plateau" not in check_of(held(0.4, 6e5, growth=growth, position=P.y_max), CHECK).value


def test_a_valve_that_is_not_fully_open_shows_no_plateau(check_of):
    wide = P.R_0vs + 0.95 * (P.R_1vs - P.R_0vs)
    narrow = P.R_0vs + 0.8 * (P.R_1vs - P.R_0vs)
    assert "plateau" in check_of(held(0.5, opening=wide), CHECK).value
    assert "plateau" not in check_of(held(0.5, opening=narrow), CHECK).value


def test_while_the_exhaust_is_open_as_well_nothing_is_a_plateau(check_of):
    log = held(0.5)
    assert "plateau" not in check_of(log.with_columns(duty_exhaust=log["duty_supply"]), CHECK).value


def test_without_a_plateau_the_supply_is_above_what_the_chamber_reaches(check_of):
    seen = check_of(held(0.1, 6e5), CHECK)
    assert (seen.value, seen.grade) == ("at least 6 bar", "undetermined")
    assert check_of(held(0.1, 1.03 * P.P_S), CHECK).grade == "bad"
