"""An argument of a wrong kind is one sentence that names it, in every public function."""

import inspect

import numpy as np
import pytest

import clutchid
from clutchid import Actuator, DataError, FitRequest, Log, ParameterError, Partition, Prior
from clutchid.arguments import checked
from fixtures.public_records import annotations

FUNCTIONS = {name: getattr(clutchid, name) for name in clutchid.__all__}
FUNCTIONS = {name: item for name, item in FUNCTIONS.items() if inspect.isfunction(item)}

ARGUMENTS = [(name, place) for name, item in FUNCTIONS.items() for place in inspect.signature(item).parameters]

#: Wrong kinds, of which an argument may admit some.
WRONG = (
    object(),
    3,
    2.5,
    "text",
    b"bytes",
    None,
    True,
    [Actuator()],
    {"P_S": 9e5},
    (1, 2, 3),
    Actuator,
    Prior(1.0, 1.0),
)

LOG = Log(np.arange(0.0, 0.01, 1e-3), {"position": np.zeros(10)})


def needed(name):
    """Arguments that a function needs."""
    return {
        parameter.name
        for parameter in inspect.signature(FUNCTIONS[name]).parameters.values()
        if parameter.default is parameter.empty
    }


@pytest.mark.parametrize(("name", "place"), ARGUMENTS)
def test_an_argument_of_a_wrong_kind_is_one_sentence(name, place):
    """Also where the value is admitted, because what else the function needs is then wrong."""
    others = dict.fromkeys(needed(name) - {place}, object())
    for value in WRONG if others else WRONG[:1]:
        said = f"^{name}: .* (needed|of a file), not .*|^{name}: .* Known are "
        with pytest.raises((DataError, ParameterError), match=said) as caught:
            FUNCTIONS[name](**{place: value}, **others)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [name for name, item in FUNCTIONS.items() if inspect.signature(item).parameters])
def test_every_public_function_checks_its_arguments(name):
    function = FUNCTIONS[name]
    assert hasattr(function, "__wrapped__")
    assert set(annotations(function)) - {"return"} == set(inspect.signature(function).parameters)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: FitRequest(priors={"P_S": 9e5}), r"FitRequest: priors\['P_S'\] = 900000.0: a Prior is needed"),
        (lambda: clutchid.fit(LOG, [Actuator()]), r"fit: actuator = \[Actuator\(\)\]: an Actuator or None is needed"),
        (lambda: clutchid.fit([LOG, 3]), r"fit: logs\[1\] = 3: a recording is a clutchid.Log or the path of a file"),
        (lambda: clutchid.fit(LOG, bounds={"P_S": (1, 2, 3)}), r"bounds\['P_S'\] = .*a tuple of 2 is needed"),
        (lambda: clutchid.fit(LOG, bounds={3: (1, 2)}), "fit: a key of bounds = 3: a text is needed"),
        (lambda: clutchid.fit(LOG, on_failure="rise"), "on_failure = 'rise': no .*; did you mean 'raise'"),
        (lambda: FitRequest(bootstrap=True), "FitRequest: bootstrap = True: a whole number is needed"),
        (lambda: clutchid.estimate(LOG, Actuator()), "start = an Actuator: a Fit, a ParameterFile or a path is needed"),
        (lambda: clutchid.simulate(LOG, Actuator()), "simulate: actuator = a Log: an Actuator is needed, not a Log"),
        (lambda: clutchid.simulate(Actuator(), LOG, starts=[1.0]), r"starts\[0\] = 1.0: a tuple of 2 is needed"),
        (lambda: clutchid.export("cal.toml", "out", to=[1]), r"export: to\[0\] = 1: one of 'c', .* is needed"),
        (lambda: clutchid.track([LOG], "cal.toml"), r"track: recordings\[0\] = a Log: a path is needed"),
        (lambda: clutchid.fleet("a", "b", "c", place=4), "fleet: place = 4: Workers is needed"),
        (lambda: clutchid.cut(LOG, channels=3), "cut: channels = 3: a ChannelMap, a path or None is needed"),
        (lambda: Prior(np.timedelta64(9, "s"), 1.0), "Prior: mean = a timedelta64: a number is needed"),
        (lambda: clutchid.Parameters(P_S=np.timedelta64(9, "s")), "P_S = .*: a number in Pa is needed"),
        (lambda: Prior("9 bar", 1.0), "Prior: mean = '9 bar': a number is needed, not a text"),
        (lambda: Partition(every=2.5), "Partition: every = 2.5: a whole number or None is needed, not a number"),
    ],
)  # fmt: skip
def test_a_sentence_says_what_where_and_what_is_needed(call, said):
    with pytest.raises((DataError, ParameterError), match=said) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_what_is_like_a_number_or_a_list_is_admitted(tmp_path):
    @checked
    def admitted(share: float, count: int = 1, names: "list[str] | str" = "a", path: "str | None" = None) -> float:
        return share + count

    for share in (1, 1.5, np.float32(2.0), np.int64(3)):
        assert admitted(share, np.int32(1), ("a", "b")) == share + 1
    assert admitted(0.0, names=(name for name in "ab")) == 1.0
    simulation = clutchid.simulate(
        Actuator(), LOG.with_columns(duty_supply=LOG.time, duty_exhaust=LOG.time), sensitivities=("P_S",)
    )
    assert simulation.status == "ok"
