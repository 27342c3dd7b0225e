"""Observer and actuator as FMUs: what the file holds, and that its steps are those of the replay and of Python."""

from __future__ import annotations

import ctypes
import io
import re
import subprocess
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from sympy import symbols

from clutchid.codegen.c99 import CSource
from clutchid.codegen.templates import template
from clutchid.errors import ExportError, ParameterError
from clutchid.exports import fmu
from clutchid.exports.c99 import CStyle, observer_c99
from clutchid.exports.fmu import model_fmu, observer_fmu, platforms
from clutchid.exports.outputs import OUTPUTS
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.model.equipment import Equipment
from clutchid.model.own import OwnModel, OwnParameter, OwnState
from clutchid.observer import observer, start
from clutchid.simulation import simulate

pytestmark = pytest.mark.slow

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-Wconversion", "-Wfloat-equal")
SECONDS = 3.0
STEP = 1e-3
STYLE = CStyle("clutch", "double")


@dataclass(frozen=True)
class Exported:
    """An FMU that lies unpacked in a folder, with its variables: kind and value reference by name."""

    content: bytes
    folder: Path
    name: str
    variables: Mapping[str, tuple[str, int]]
    guid: str

    def instance(self) -> Instance:
        library = ctypes.CDLL(str(self.folder / "binaries" / "linux64" / f"{self.name}.so"))
        library.fmi2Instantiate.restype = ctypes.c_void_p
        made = library.fmi2Instantiate(b"it", 1, self.guid.encode(), None, None, 0, 0)
        assert made is not None
        return Instance(library, ctypes.c_void_p(made), self.variables)


@dataclass(frozen=True)
class Instance:
    """An instance of an FMU behind ctypes; its functions return the status."""

    library: ctypes.CDLL
    component: ctypes.c_void_p
    variables: Mapping[str, tuple[str, int]]

    def call(self, name: str, *arguments: object) -> int:
        status: int = getattr(self.library, f"fmi2{name}")(self.component, *arguments)
        return status

    def begin(self, **values: float) -> Instance:
        """Initialise with values of parameters, whose dots are two underscores."""
        begin = ctypes.c_double(0.0)
        assert self.call("SetupExperiment", 0, ctypes.c_double(0.0), begin, 0, ctypes.c_double(0.0)) == 0
        assert self.call("EnterInitializationMode") == 0
        assert self.put({name.replace("__", "."): value for name, value in values.items()}) == 0
        assert self.call("ExitInitializationMode") == 0
        return self

    def put(self, values: Mapping[str, float]) -> int:
        places = (ctypes.c_uint * len(values))(*(self.variables[name][1] for name in values))
        return self.call(
            "SetReal", places, ctypes.c_size_t(len(values)), (ctypes.c_double * len(values))(*values.values())
        )

    def get(self, names: Sequence[str]) -> list[float]:
        types = {"Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int}
        found = []
        for name in names:
            kind, place = self.variables[name]
            value = types[kind]()
            places = ctypes.byref(ctypes.c_uint(place))
            assert self.call(f"Get{kind}", places, ctypes.c_size_t(1), ctypes.byref(value)) == 0
            found.append(float(value.value))
        return found

    def step(self, time: float, step: float = STEP) -> int:
        return self.call("DoStep", ctypes.c_double(time), ctypes.c_double(step), 1)

    def follow(self, inputs: Mapping[str, np.ndarray], outputs: Sequence[str], first: int, last: int) -> np.ndarray:
        """Outputs after the steps that begin at these samples."""
        found = []
        for k in range(first, last):
            assert self.put({name: float(values[k]) for name, values in inputs.items()}) == 0
            assert self.step(k * STEP) == 0
            found.append(self.get(outputs))
        return np.array(found)


def described(content: bytes) -> ElementTree.Element:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def unpacked(content: bytes, folder: Path) -> Exported:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(folder)
    root = described(content)
    rows = root.findall("ModelVariables/ScalarVariable")
    variables = {row.attrib["name"]: (row[0].tag, int(row.attrib["valueReference"])) for row in rows}
    return Exported(content, folder, root.attrib["modelName"], variables, root.attrib["guid"])


def compiled(exported: Exported) -> Exported:
    if not platforms(exported.content):
        pytest.skip("no C compiler (cc or gcc) on this machine, or not linux64")
    return exported


@pytest.fixture(scope="module")
def modules(plant: Actuator) -> dict[str, CSource]:
    found = observer(plant)
    return observer_c99(found, start(found), STYLE, "a test")


@pytest.fixture(scope="module")
def observing(plant: Actuator, modules: dict[str, CSource], tmp_path_factory: pytest.TempPathFactory) -> Exported:
    found = observer(plant)
    return unpacked(observer_fmu(found, start(found), STYLE, modules), tmp_path_factory.mktemp("observer"))


@pytest.fixture(scope="module")
def modelled(plant: Actuator, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return unpacked(model_fmu(plant), tmp_path_factory.mktemp("model"))


@pytest.fixture(params=["observing", "modelled"])
def exported(request: pytest.FixtureRequest) -> Exported:
    found: Exported = request.getfixturevalue(request.param)
    return found


@pytest.fixture
def runs(exported: Exported) -> Exported:
    """Those with a binary for this machine."""
    return compiled(exported)


@pytest.fixture(scope="module")
def inputs(drive_log: Log) -> dict[str, np.ndarray]:
    duties = {name: drive_log[name] for name in ("duty_supply", "duty_exhaust")}
    return {**duties, "position_measured": drive_log["position"]}


def given(exported: Exported, inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: values for name, values in inputs.items() if name in exported.variables}


def outputs_of(exported: Exported) -> list[str]:
    rows = described(exported.content).findall("ModelVariables/ScalarVariable")
    return [row.attrib["name"] for row in rows if row.attrib["causality"] in ("output", "local")]


def test_an_fmu_holds_its_description_and_the_sources_that_this_names(exported):
    with zipfile.ZipFile(io.BytesIO(exported.content)) as archive:
        held = set(archive.namelist())
        assert {entry.date_time for entry in archive.infolist()} == {fmu.DATE}
    files = {file.attrib["name"] for file in described(exported.content).findall("CoSimulation/SourceFiles/File")}
    sources = {name.removeprefix("sources/") for name in held if name.endswith(".c")}
    assert files == sources
    assert "modelDescription.xml" in held
    assert not any(name.endswith("fmi2Functions.h") for name in held)  # the standard leaves it to the importer


def test_every_variable_has_its_own_reference_a_known_unit_and_a_start_where_it_is_set(exported):
    root = described(exported.content)
    rows = root.findall("ModelVariables/ScalarVariable")
    units = {unit.attrib["name"] for unit in root.findall("UnitDefinitions/Unit")}
    for kind in {row[0].tag for row in rows}:
        places = [int(row.attrib["valueReference"]) for row in rows if row[0].tag == kind]
        assert places == list(range(len(places)))
    for row in rows:
        assert row.attrib["description"]
        assert row[0].attrib.get("unit") in units | {None}
        assert ("start" in row[0].attrib) == (row.attrib["causality"] in ("input", "parameter"))
    outputs = [i for i, row in enumerate(rows, 1) if row.attrib["causality"] == "output"]
    assert [int(one.attrib["index"]) for one in root.findall("ModelStructure/Outputs/Unknown")] == outputs
    assert len(exported.variables) == len(rows)


def test_units_are_products_of_base_units(modelled):
    units = {
        unit.attrib["name"]: unit[0].attrib for unit in described(modelled.content).findall("UnitDefinitions/Unit")
    }
    assert units["Pa"] == {"kg": "1", "m": "-1", "s": "-2"}
    assert units["m³/(Pa·s)"] == {"kg": "-1", "m": "4", "s": "1"}


def test_the_same_calibration_gives_the_same_bytes_and_another_one_another_guid(modelled, plant):
    assert model_fmu(plant) == modelled.content
    other = described(model_fmu(plant.replace(F_C=plant.parameters.F_C * 1.01)))
    assert other.attrib["guid"] != modelled.guid


def test_without_a_compiler_an_fmu_has_only_sources(monkeypatch, plant):
    monkeypatch.setattr("shutil.which", lambda name: None)
    content = model_fmu(plant)
    assert platforms(content) == ()
    assert described(content).findall("CoSimulation/SourceFiles/File")


def test_a_compiler_that_fails_is_an_error_with_its_words(plant, modules, observing):
    compiled(observing)
    found = observer(plant)
    broken = {**modules, "clutch": replace(modules["clutch"], source="int x = unknown_name;\n")}
    with pytest.raises(ExportError, match="unknown_name"):
        observer_fmu(found, start(found), STYLE, broken)


def test_a_name_that_c_does_not_take_is_refused(plant):
    with pytest.raises(ParameterError, match="no C identifier"):
        model_fmu(plant, "truck 1")


def test_its_sources_compile_without_a_warning(runs):
    (runs.folder / "sources" / "fmi2Functions.h").write_text(
        template("fmi2Functions.h.j2", "clutchid.exports").render()
    )
    sources = sorted(str(file) for file in (runs.folder / "sources").glob("*_fmu.c"))
    command = ["cc", *STRICT, "-O1", "-c", "-o", str(runs.folder / "fmu.o"), *sources]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_its_library_has_every_function_of_the_standard_and_no_other(runs):
    header = template("fmi2Functions.h.j2", "clutchid.exports").render()
    functions = set(re.findall(r"FMI2_Export [\w ]+\*?\b(fmi2\w+)\(", header))
    library = ctypes.CDLL(str(runs.folder / "binaries" / "linux64" / f"{runs.name}.so"))
    assert len(functions) == 44
    assert all(hasattr(library, name) for name in functions)
    assert not hasattr(library, f"{runs.name}_model_step")


def test_steps_of_the_observer_are_those_of_the_replay(observing, modules, inputs):
    compiled(observing)
    n = round(SECONDS / STEP)
    replay = template("replay.c.j2", "clutchid.exports")
    folder = observing.folder / "sources"
    names = list(OUTPUTS)
    values = {"name": "clutch", "real": "double", "positions": [5e-3], "begins_us": 0, "outputs": names}
    (folder / "replay.c").write_text(replay.render(values))
    files = [str(folder / f"{stem}.c") for stem in ("replay", *modules)]
    subprocess.run(["cc", "-std=c99", "-O0", "-o", str(folder / "replay"), *files, "-lm"], check=True)
    columns = [inputs[name][:n] for name in ("position_measured", "duty_supply", "duty_exhaust")]
    samples = np.column_stack([*columns, np.full(n, np.nan), np.where(np.arange(n) > 0, 1000.0, 0.0)])
    done = subprocess.run([str(folder / "replay")], input=samples.tobytes(), capture_output=True, check=True)
    replayed = np.frombuffer(done.stdout)
    instance = observing.instance().begin(load_position=5e-3)
    found = instance.follow(inputs, names, 0, n)
    np.testing.assert_array_equal(found, replayed[: len(names) * n].reshape(n, -1))
    load = replayed[len(names) * n :][:3]
    np.testing.assert_array_equal(instance.get(["load", "load_low", "load_high"]), load)
    assert np.isfinite(found[:, 0]).all()


def test_an_observer_takes_a_sample_a_millisecond_whatever_the_step(observing, inputs):
    compiled(observing)
    whole = observing.instance().begin().follow(inputs, ["pressure_a", "load"], 0, 500)
    parts = observing.instance().begin()
    for k in range(500):
        parts.put({name: float(values[k]) for name, values in inputs.items()})
        assert [parts.step(k * STEP + i * STEP / 4, STEP / 4) for i in range(4)] == [0] * 4
    np.testing.assert_array_equal(parts.get(["pressure_a", "load"]), whole[-1])


@pytest.mark.parametrize("step", [2 * STEP, 0.01, 0.02])
def test_an_observer_refuses_a_step_that_holds_its_inputs_for_several_samples(observing, inputs, step):
    compiled(observing)
    instance = observing.instance().begin()
    assert instance.step(0.0, step) == 3
    assert instance.step(0.0, STEP * (1 + 1e-9)) == 0  # as an importer counts its own time
    assert "steps of at most 0.001 s" in str(described(observing.content).get("description"))


def test_a_parameter_that_adapts_may_begin_elsewhere(observing):
    compiled(observing)
    name = next(name for name in observing.variables if name.startswith("start.theta_9"))
    (usual, load), weight = observing.instance().begin().get([name, "load"]), name.removeprefix("start.")
    moved = observing.instance().begin(**{name.replace(".", "__"): usual * 1.01})
    assert moved.get([weight])[0] == pytest.approx(usual * 1.01, rel=1e-12)
    assert observing.instance().begin().get([weight, "load"]) == [usual, load]


@pytest.mark.parametrize("model", ["energy-balance-stribeck", "isothermal"])
def test_steps_of_the_model_are_those_of_a_simulation(model, plant, inputs, tmp_path):
    actuator = replace(plant, model=model).replace(T_pwm=5e-3 if model != "isothermal" else 0.0, s_pwm=0.3e-3)
    exported = unpacked(model_fmu(actuator, "plant"), tmp_path)
    compiled(exported)
    n = round(SECONDS / STEP)
    duties = given(exported, inputs)
    log = Log(np.arange(n) * STEP, {name: values[:n] for name, values in duties.items()})
    simulated = simulate(actuator, log).log
    instance = exported.instance().begin()
    names = ["position", "velocity", "pressure_a", "pressure_b"]
    found = np.array([instance.get(names), *instance.follow(duties, names, 0, n - 1)])
    for name, values in zip(names, found.T, strict=True):
        np.testing.assert_allclose(values, simulated[name], rtol=0, atol=1e-8 * np.ptp(simulated[name]))
    position = np.array(instance.get(["position"]))
    assert instance.get(["load"])[0] == pytest.approx(actuator.load.force(position)[0], rel=1e-9)


def test_a_model_of_ones_own_is_exported_with_its_states_and_parameters(inputs, tmp_path):
    v, z_2, K_2, s_2, f_f = symbols("v z_2 K_2 s_2 f_f")
    element = OwnModel(
        "isothermal",
        parameters={
            "K_2": OwnParameter(4e5, "N/m", "stiffness of the seal */", range=(1e3, 1e8), std=1e5),
            "s_2": OwnParameter(50.0, "1/s", "its relaxation", range=(1, 1e3), std=10),
        },
        states={"z_2": OwnState("m", "deflection of the seal", scale=1e-4, noise=5e-6)},
        rates={"z_2": v - s_2 * z_2},
        terms={"f_f": f_f + K_2 * z_2},
    )
    exported, n = unpacked(model_fmu(Actuator(model=element)), tmp_path), 500
    assert {"K_2", "z_2"} <= set(exported.variables)
    duties = given(compiled(exported), inputs)
    log = Log(np.arange(n) * STEP, {name: values[:n] for name, values in duties.items()})
    simulated = simulate(Actuator(model=element), log).log
    found = exported.instance().begin().follow(duties, ["position", "z_2"], 0, n - 1)
    np.testing.assert_allclose(found[:, 0], simulated["position"][1:], rtol=0, atol=1e-12)


def test_a_model_takes_other_parameters_and_another_start(modelled, plant):
    compiled(modelled)
    instance = modelled.instance().begin(start__position=0.01, start__pressure_a=4e5, P_0=1.0e5)
    assert instance.get(["position", "pressure_a", "pressure_b"]) == [0.01, 4e5, 1.0e5]
    before = instance.get(["load"])[0]
    weights = {name: 1.1 * value for name, value in zip(plant.load.names, plant.load.theta, strict=True)}
    assert instance.put(weights) == 0
    assert instance.step(0.0, 1e-6) == 0
    assert instance.get(["load"])[0] == pytest.approx(1.1 * before, rel=1e-3)


def test_a_valve_that_does_not_exist_has_no_input(plant, tmp_path):
    exported = unpacked(model_fmu(replace(plant, equipment=Equipment(valves="3/2"))), tmp_path)
    assert "duty_exhaust" not in exported.variables
    if platforms(exported.content):
        instance = exported.instance().begin(start__position=0.01, start__pressure_a=4e5)
        assert [instance.step(k * STEP) for k in range(200)] == [0] * 200
        assert instance.get(["pressure_a"])[0] < 1.5e5  # closed is vented


def test_a_state_that_is_restored_goes_on_as_before(runs, inputs):
    used, names, instance = given(runs, inputs), outputs_of(runs), runs.instance().begin()
    instance.follow(used, names, 0, 700)
    kept, size = ctypes.c_void_p(), ctypes.c_size_t()
    assert instance.call("GetFMUstate", ctypes.byref(kept)) == 0
    assert instance.call("SerializedFMUstateSize", kept, ctypes.byref(size)) == 0
    written = (ctypes.c_char * size.value)()
    assert instance.call("SerializeFMUstate", kept, written, size) == 0
    on = instance.follow(used, names, 700, 1400)
    assert instance.call("SetFMUstate", kept) == 0
    np.testing.assert_array_equal(instance.follow(used, names, 700, 1400), on)
    assert instance.call("FreeFMUstate", ctypes.byref(kept)) == 0
    assert kept.value is None
    other, read = runs.instance(), ctypes.c_void_p()
    assert other.call("DeSerializeFMUstate", written, size, ctypes.byref(read)) == 0
    assert other.call("SetFMUstate", read) == 0
    np.testing.assert_array_equal(other.follow(used, names, 700, 1400), on)
    written[0] = b"?"
    assert other.call("DeSerializeFMUstate", written, size, ctypes.byref(read)) == 3


def test_instances_do_not_disturb_each_other_and_a_reset_begins_anew(runs, inputs):
    used, names = given(runs, inputs), outputs_of(runs)
    alone = runs.instance().begin().follow(used, names, 0, 800)
    one, two = runs.instance().begin(), runs.instance().begin()
    backwards = {name: values[::-1] for name, values in used.items()}
    both = [(one.follow(used, names, k, k + 1)[0], two.follow(backwards, names, k, k + 1)[0]) for k in range(800)]
    np.testing.assert_array_equal(np.array([first for first, _ in both]), alone)
    assert two.call("Reset") == 0
    np.testing.assert_array_equal(two.begin().follow(used, names, 0, 800), alone)


def test_calls_that_the_standard_forbids_are_errors(runs):
    error, instance = 3, runs.instance()
    fixed = next(name for name in runs.variables if name.startswith("start."))
    assert instance.step(0.0) == error
    instance.begin()
    assert instance.put({fixed: 0.0}) == error
    assert instance.put({"load": 1.0}) == error
    assert instance.step(0.5) == error
    assert instance.step(0.0, 0.0) == error
    assert instance.step(0.0) == 0
    assert instance.call("Terminate") == 0
    assert instance.step(STEP) == error
    assert instance.library.fmi2Instantiate(b"it", 1, b"{another}", None, None, 0, 0) is None
    assert instance.library.fmi2Instantiate(b"it", 0, runs.guid.encode(), None, None, 0, 0) is None


def test_a_model_that_diverges_ends_with_an_error(modelled):
    compiled(modelled)
    instance = modelled.instance().begin(start__position=float("nan"))
    assert instance.step(0.0) == 3
    assert instance.step(STEP) == 3


def test_fmpy_finds_nothing_wrong_and_simulates_the_same(runs, inputs, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy, which checks FMUs, is not installed: pip install fmpy")
    validation = pytest.importorskip("fmpy.validation", reason="fmpy is not installed: pip install fmpy")
    file = tmp_path / "it.fmu"
    file.write_bytes(runs.content)
    assert validation.validate_fmu(str(file)) == []
    used, n = given(runs, inputs), 1000
    signals = np.zeros(n + 1, dtype=[("time", float), *((name, float) for name in used)])
    signals["time"] = np.arange(n + 1) * STEP
    for name, values in used.items():
        signals[name] = values[: n + 1]
    names = ["position", "pressure_a", "load"]
    result = fmpy.simulate_fmu(str(file), start_time=0.0, stop_time=n * STEP, step_size=STEP, output_interval=STEP,
                               input=signals, output=names)  # fmt: skip
    found = runs.instance().begin().follow(used, names, 0, n)
    np.testing.assert_allclose(np.column_stack([result[name][1:] for name in names]), found, rtol=1e-6, atol=1e-9)
