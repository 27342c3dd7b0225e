"""Both families: types by number, the same public functions, and the changes between calibration and use."""

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.preparation.inspection import inspect
from clutchid.truck import Truck, TruckB, aged, changed, drive, load_curve, respond, truck
from clutchid.truck.families import RANGE_FILES, family_ranges

NUMBERS = [*range(24), *range(1000, 1024)]


@pytest.mark.parametrize("family", RANGE_FILES)
def test_a_number_is_always_the_same_truck_and_another_number_another(family):
    trucks = [truck(n, family) for n in NUMBERS]
    assert trucks == [truck(n, family) for n in NUMBERS]
    assert len(set(trucks)) == len(NUMBERS)


@pytest.mark.parametrize("family", RANGE_FILES)
def test_trucks_lie_in_the_ranges_of_their_file_and_all_variants_occur(family):
    trucks, table = [truck(n, family) for n in NUMBERS], family_ranges(RANGE_FILES[family])
    for name, (low, high) in table["uniform"].items():
        drawn = np.array([getattr(kind, name) for kind in trucks])
        size = np.abs(drawn) if name == "e_lin" else drawn
        assert low <= size.min() <= size.max() <= high, name
        assert np.ptp(drawn) > 0.5 * (high - low), name
        assert name != "e_lin" or drawn.min() < 0 < drawn.max()
    for name, values in table["choice"].items():
        if name != "bend":
            assert {getattr(kind, name) for kind in trucks} >= set(values), name


@pytest.mark.parametrize("family", RANGE_FILES)
@pytest.mark.parametrize("number", NUMBERS[:12])
def test_every_truck_can_wear_to_the_end_of_its_facing(number, family):
    new = truck(number, family)
    peaks = [load_curve(aged(new, w, 3e5)).force(np.linspace(0, 0.02, 200)).max() for w in (0.0, new.w_max)]
    assert min(peaks) > 3e3
    assert max(peaks) < 6.5e3


@pytest.mark.parametrize("family", RANGE_FILES)
def test_a_recording_of_either_family_has_the_columns_of_the_contract(family):
    driven = drive(truck(3, family), seconds=1, seed=1)
    assert list(driven.log.columns) == ["position", "duty_supply", "duty_exhaust", "pressure_a"]
    bus = drive(truck(3, family), seconds=4, recorder="bus", dropouts=2, pressure=False).log
    assert 395 <= len(bus) <= 401
    assert "pressure_a" not in bus
    assert {"pressure_a", "pressure_b", "pressure_supply", "position"} <= set(driven.truth.log.columns)


@pytest.mark.parametrize("family", RANGE_FILES)
def test_the_same_seed_gives_the_same_bytes_and_another_one_does_not(family):
    def content(seed: int) -> bytes:
        driven = drive(truck(3, family), seconds=3, seed=seed, wear=1e-3, recorder="bus", dropouts=3)
        return b"".join([driven.log.time.tobytes(), *(v.tobytes() for v in driven.log.columns.values())])

    assert content(5) == content(5)
    assert content(5) != content(6)


@pytest.mark.parametrize("number", [0, 3, 5, 9])
def test_a_recording_of_a_healthy_truck_of_the_second_family_is_without_a_warning(number):
    inspection = inspect(drive(truck(number, "B"), seconds=20, seed=number).log)
    assert inspection.warnings == ()
    assert {check.grade for check in inspection.checks} <= {"good", "undetermined"}


def at_rest(t):
    """The states of a truck 6 s after a pulse, the force of its air on the piston and its load there in N."""
    supply = np.zeros(6000)
    supply[100:180] = 0.6
    response = respond(t, supply, np.zeros(6000))
    x = {name: values[-1] for name, values in response.truth.states.items()}
    air = t.A_A * (x["pressure_a"] - t.P_0) - t.A_B * (x["pressure_b"] - t.P_0)
    return x, air, response.truth.load(np.array([x["position"]]))[0]


@pytest.mark.parametrize("family", RANGE_FILES)
def test_the_truth_of_the_load_is_the_load_that_holds_the_plant_at_rest(family):
    new = truck(6, family)
    x, air, load = at_rest(new)
    assert 3e-3 < x["position"] < 0.02
    assert abs(x["velocity"]) < 2e-4
    # friction of the seals at most 1.5 (180 + 200) or 1.6 (200 + 150) N, hysteresis of the load 5 % and 40 N
    assert abs(air - load) < 600 + 0.05 * load + 40
    # with little friction within that, but for the force that its slow motion needs
    smooth = {"A": {"F_C": 20.0, "c_F": 0.0, "F_h": 20.0, "mu_h": 0.0}, "B": {"F_C": 2.0, "F_p": 0.0, "F_b": 1.0}}
    smooth["B"] |= {"mu_b": 0.0, "mu_f": 0.0}
    x, air, load = at_rest(new.replace(smooth[family]))
    assert air == pytest.approx(load, abs={"A": 52, "B": 5}[family] + 1.6e4 * abs(x["velocity"]))


@pytest.mark.parametrize("family", RANGE_FILES)
def test_every_change_changes_what_its_sentence_says(family):
    new = truck(0, family)
    flows, friction = {"A": (("C_s", "C_e"), ("F_C", "c_F")), "B": (("A_s", "A_e"), ("F_C", "F_p"))}[family]
    assert changed(new, "supply") == new.replace({"P_S": 0.95 * new.P_S})
    assert changed(new, "seals") == new.replace({name: 1.4 * getattr(new, name) for name in friction})
    slow = changed(new, "valves")
    assert [getattr(slow, name) / getattr(new, name) for name in flows] == pytest.approx([0.93, 0.93])
    times = {"A": ("t_1s", "t_4e"), "B": ("tau_x", "t_n", "tau_is", "t_xe")}[family]
    assert [getattr(slow, name) / getattr(new, name) for name in times] == pytest.approx([1.2] * len(times))
    assert changed(new, "cold", "seals") == changed(changed(new, "cold"), "seals")


@pytest.mark.parametrize(("family", "number"), [("A", 0), ("A", 9), ("B", 0), ("B", 9)])
@pytest.mark.parametrize(("change", "kelvin", "factor"), [("cold", -30.0, 2.0), ("warm", 30.0, 0.6)])
def test_cold_and_warm_grease_is_thicker_and_thinner_by_the_factor_of_the_change(
    family, number, change, kelvin, factor
):
    def viscous(t):
        T = t.T_0 + t.dT_w
        if isinstance(t, Truck):
            return t.D_v * np.exp(-t.beta * (T - 293.15))
        return t.D_v * np.exp(t.B_V / (T - t.T_V) - t.B_V / (293.15 - t.T_V))

    new = truck(number, family)
    other = changed(new, change)
    assert pytest.approx(kelvin) == other.T_0 - new.T_0
    assert viscous(other) / viscous(new) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("family", RANGE_FILES)
def test_a_recording_under_a_change_is_that_of_the_changed_truck(family):
    by_name = drive(truck(1, family), seconds=1, seed=3, change="supply")
    by_hand = drive(changed(truck(1, family), "supply"), seconds=1, seed=3)
    assert np.array_equal(by_name.log["position"], by_hand.log["position"])
    pair = drive(truck(1, family), seconds=1, seed=3, change=("supply", "cold"))
    assert pair.truth.truck == changed(truck(1, family), "supply", "cold")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "numbers"), [("A", (0, 4, 8, 13, 14)), ("B", range(6)), ("h:3", (0,)), ("h:12", (0,))]
)
def test_a_tick_is_fine_enough_for_every_truck(lab, family, numbers):
    for number in numbers:
        driven = drive(truck(number, family), seconds=6, seed=number, wear=1e-3)
        duties = np.column_stack([driven.log["duty_supply"], driven.log["duty_exhaust"]])
        rough, fine = (lab.states(driven.truth.truck, duties, substeps)[:, 0] for substeps in (1, 4))
        assert np.ptp(fine) > 15e-3
        # a tenth of the noise and of the quantum of the position sensor
        assert np.abs(rough - fine).max() < 1e-6


def test_an_unknown_family_or_change_is_named_in_one_sentence():
    with pytest.raises(ParameterError, match="family 'C': must be A or B, or a hybrid h:SEED"):
        truck(0, family="C")
    with pytest.raises(ParameterError, match="did you mean 'cold'"):
        drive(Truck(), seconds=1, change="colt")


def test_fingers_that_are_too_soft_snap_through():
    with pytest.raises(ParameterError, match="snaps through"):
        load_curve(TruckB(K_s=1e5, F_v=200.0, x_v=0.02, x_0=0.005))
