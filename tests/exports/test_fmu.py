"""Observer and actuator as FMUs: what the file holds, and that its steps are those of the replay and of Python."""

from __future__ import annotations

import ctypes
import io
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from sympy import symbols

from clutchid.codegen.c99 import CSource
from clutchid.codegen.templates import template
from clutchid.errors import ExportError
from clutchid.exports import fmu
from clutchid.exports.c99 import CStyle, observer_c99
from clutchid.exports.fmu import missing_parts, model_fmu, observer_fmu, platforms
from clutchid.exports.outputs import OUTPUTS
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.model.equipment import Equipment
from clutchid.model.own import OwnModel, OwnParameter, OwnState
from clutchid.observer import observer, start
from clutchid.simulation import simulate
from fixtures.programs import path_of, tried

pytestmark = pytest.mark.slow

Made = Callable[[str, fmu.Version], "Exported"]

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-Wconversion", "-Wfloat-equal")
SECONDS = 3.0
STEP = 1e-3
STYLE = CStyle("clutch", "double")


TYPES = {
    **{"Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int},
    **{"Float64": ctypes.c_double, "UInt32": ctypes.c_uint32, "Boolean3": ctypes.c_bool},
}
LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


@dataclass(frozen=True)
class Row:
    """A variable of a description: type, value reference, number of values, and its attributes."""

    type: str
    place: int
    size: int
    attributes: Mapping[str, str]


@dataclass(frozen=True)
class Exported:
    """An FMU that lies unpacked in a folder, with its variables by name."""

    content: bytes
    folder: Path
    name: str
    version: int
    variables: Mapping[str, Row]
    token: str

    @property
    def library(self) -> ctypes.CDLL:
        folder = {2: "linux64", 3: "x86_64-linux"}[self.version]
        library = ctypes.CDLL(str(self.folder / "binaries" / folder / f"{self.name}.so"))
        for name in {2: ("",), 3: ("CoSimulation", "ModelExchange", "ScheduledExecution")}[self.version]:
            getattr(library, f"fmi{self.version}Instantiate{name}").restype = ctypes.c_void_p
        return library

    def instantiated(self, token: str, logger: object = None, events: int = 0) -> int | None:
        """Address of an instance for co-simulation; None if it is refused."""
        if self.version == 2:
            return self.library.fmi2Instantiate(b"it", 1 - events, token.encode(), None, None, 0, 0)
        none = (None, ctypes.c_size_t(0), None, logger, None)
        return self.library.fmi3InstantiateCoSimulation(b"it", token.encode(), None, 0, 1, events, 0, *none)

    def instance(self, logger: object = None) -> Instance:
        address = self.instantiated(self.token, logger)
        assert address is not None
        return Instance(self.library, ctypes.c_void_p(address), self.variables, self.version)


@dataclass(frozen=True)
class Instance:
    """An instance of an FMU behind ctypes; its functions return the status."""

    library: ctypes.CDLL
    component: ctypes.c_void_p
    variables: Mapping[str, Row]
    version: int

    def call(self, name: str, *arguments: object) -> int:
        """Call a function by its name in FMI 2.0."""
        if self.version == 3:
            name = name.replace("DeS", "Des").replace("FMUstate", "FMUState")
        status: int = getattr(self.library, f"fmi{self.version}{name}")(self.component, *arguments)
        return status

    def begin(self, **values: float) -> Instance:
        """Initialise with values of parameters, whose dots are two underscores."""
        begin, zero = ctypes.c_double(0.0), ctypes.c_double(0.0)
        times = (0, zero, begin, 0, zero)
        assert self.version == 3 or self.call("SetupExperiment", *times) == 0
        assert self.call("EnterInitializationMode", *(times if self.version == 3 else ())) == 0
        assert self.put({name.replace("__", "."): value for name, value in values.items()}) == 0
        assert self.call("ExitInitializationMode") == 0
        return self

    def exchange(self, verb: str, kind: str, names: Sequence[str], values: ctypes.Array) -> int:
        places = (ctypes.c_uint * len(names))(*(self.variables[name].place for name in names))
        count = (ctypes.c_size_t(len(values)),) if self.version == 3 else ()
        return self.call(f"{verb}{kind}", places, ctypes.c_size_t(len(names)), values, *count)

    def put(self, values: Mapping[str, float]) -> int:
        flat = np.concatenate([np.ravel(value) for value in values.values()] or [np.zeros(0)])
        kind = "Real" if self.version == 2 else "Float64"
        return self.exchange("Set", kind, list(values), (ctypes.c_double * flat.size)(*flat))

    def get(self, names: Sequence[str]) -> list[float]:
        values: list[float] = []
        for name in names:
            row = self.variables[name]
            read = (TYPES["Boolean3" if (row.type, self.version) == ("Boolean", 3) else row.type] * row.size)()
            assert self.exchange("Get", row.type, [name], read) == 0
            values += map(float, read)
        return values

    def step(self, time: float, step: float = STEP) -> int:
        answers = (
            [ctypes.byref(kind()) for kind in (*[ctypes.c_bool] * 3, ctypes.c_double)] if self.version == 3 else []
        )
        return self.call("DoStep", ctypes.c_double(time), ctypes.c_double(step), 1, *answers)

    def follow(self, inputs: Mapping[str, np.ndarray], outputs: Sequence[str], first: int, last: int) -> np.ndarray:
        """Outputs after the steps that begin at these samples."""
        rows = []
        for k in range(first, last):
            assert self.put({name: float(values[k]) for name, values in inputs.items()}) == 0
            assert self.step(k * STEP) == 0
            rows.append(self.get(outputs))
        return np.array(rows)


def described(content: bytes) -> ElementTree.Element:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def rows_of(root: ElementTree.Element) -> dict[str, Row]:
    rows = {}
    for variable in root.findall("ModelVariables/*"):
        typed = variable if root.attrib["fmiVersion"] == "3.0" else variable[0]
        dimension = variable.find("Dimension")
        size = 1 if dimension is None else int(dimension.attrib["start"])
        attributes = {**variable.attrib, **typed.attrib}
        rows[attributes["name"]] = Row(typed.tag, int(attributes["valueReference"]), size, attributes)
    return rows


def unpacked(content: bytes, folder: Path) -> Exported:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(folder)
    root = described(content)
    version = int(root.attrib["fmiVersion"][0])
    token = root.attrib["guid" if version == 2 else "instantiationToken"]
    return Exported(content, folder, root.attrib["modelName"], version, rows_of(root), token)


def compiled(exported: Exported) -> Exported:
    if not any("linux" in platform for platform in platforms(exported.content)):
        pytest.skip("no C compiler (cc or gcc) on this machine, or not linux64")
    return exported


@pytest.fixture(scope="module")
def modules(plant: Actuator) -> dict[str, CSource]:
    estimator = observer(plant)
    return observer_c99(estimator, start(estimator), STYLE, "a test")


@pytest.fixture(scope="module", autouse=True)
def _programs_that_work():
    """FMUs are built without a compiler that does not work, as without any."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(fmu, "compiler", lambda: tried("cc").path or None)
        yield


@pytest.fixture(scope="module")
def made(plant: Actuator, modules: dict[str, CSource], tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The FMU of a part ("observer", "model") and a version, unpacked once."""

    @cache
    def unpack(part: str, version: fmu.Version) -> Exported:
        observing = observer(plant)
        observed = part == "observer"
        content = (
            observer_fmu(observing, start(observing), STYLE, modules, version).content
            if observed
            else model_fmu(plant, version=version).content
        )
        return unpacked(content, tmp_path_factory.mktemp(f"{part}{version}"))

    return unpack


@pytest.fixture(params=[2, 3])
def observing(request: pytest.FixtureRequest, made: Made) -> Exported:
    return compiled(made("observer", request.param))


@pytest.fixture(params=[2, 3])
def modelled(request: pytest.FixtureRequest, made: Made) -> Exported:
    return made("model", request.param)


@pytest.fixture(
    params=[("observer", 2), ("observer", 3), ("model", 2), ("model", 3)], ids=lambda p: f"{p[0]}-fmi{p[1]}"
)
def exported(request: pytest.FixtureRequest, made: Made) -> Exported:
    return made(*request.param)


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
    return [name for name, row in exported.variables.items() if row.attributes["causality"] in ("output", "local")]


def test_an_fmu_holds_its_description_and_the_sources_that_this_names(exported):
    with zipfile.ZipFile(io.BytesIO(exported.content)) as archive:
        held = set(archive.namelist())
        assert {entry.date_time for entry in archive.infolist()} == {fmu.DATE}
    description, path = exported.folder / "modelDescription.xml", "CoSimulation/SourceFiles/File"
    if exported.version == 3:
        description, path = exported.folder / "sources" / "buildDescription.xml", ".//SourceFile"
    files = {file.attrib["name"] for file in ElementTree.parse(description).findall(path)}
    assert files == {name.removeprefix("sources/") for name in held if name.endswith(".c")}
    assert not any(name.endswith("Functions.h") for name in held)  # the standard leaves it to the importer


def test_every_variable_has_its_own_reference_a_known_unit_and_a_start_where_it_is_set(exported):
    root = described(exported.content)
    units = {unit.attrib["name"] for unit in root.findall("UnitDefinitions/Unit")}
    assert [row.place for row in exported.variables.values()] == list(range(len(exported.variables)))
    for row in exported.variables.values():
        assert row.attributes["description"]
        assert row.attributes.get("unit") in units | {None}
        assert ("start" in row.attributes) == (row.attributes["causality"] in ("input", "parameter"))
        assert len(row.attributes.get("start", "0").split()) in (1, row.size)
        if row.attributes.get("unit") in ("m", "Pa", "N", "m/s"):
            assert float(row.attributes["nominal"]) > 0.0
    outputs = [row.place for row in exported.variables.values() if row.attributes["causality"] == "output"]
    unknowns = root.findall("ModelStructure/Outputs/Unknown" if exported.version == 2 else "ModelStructure/Output")
    references = [int(u.attrib.get("valueReference", -1)) for u in unknowns]
    assert [int(u.attrib["index"]) - 1 for u in unknowns] == outputs if exported.version == 2 else references == outputs
    assert all(u.attrib["dependencies"] == "" for u in unknowns)


def test_outputs_are_those_of_the_last_step_whatever_inputs_are_set_since(runs, inputs):
    used, names = given(runs, inputs), outputs_of(runs)
    instance = runs.instance().begin()
    last = instance.follow(used, names, 0, 150)[-1]
    assert instance.put(dict.fromkeys(used, 0.5)) == 0
    np.testing.assert_array_equal(instance.get(names), last)


@pytest.mark.parametrize("part", ["observer", "model"])
def test_fmi_3_gives_the_numbers_of_fmi_2_bit_by_bit(made, inputs, part):
    two, three = compiled(made(part, 2)), compiled(made(part, 3))
    names = [name for name in outputs_of(two) if name in three.variables]
    first = two.instance().begin().follow(given(two, inputs), names, 0, 600)
    second = three.instance().begin().follow(given(three, inputs), names, 0, 600)
    np.testing.assert_array_equal(first, second)
    assert np.isfinite(first[:, names.index("load")]).all()


def test_the_load_is_an_array_in_fmi_3(made, inputs, plant):
    two, three = compiled(made("observer", 2)), compiled(made("observer", 3))
    instance, scalar = three.instance().begin(), two.instance().begin()
    for variable in (instance, scalar):
        variable.follow(inputs, ["load"], 0, 600)
    grid = np.linspace(1e-3, 8e-3, three.variables["curve.position"].size)
    assert instance.put({"curve.position": grid}) == 0
    curve = np.reshape(instance.get(["curve.load", "curve.load_low", "curve.load_high"]), (3, -1))
    for i in (0, 7, grid.size - 1):
        assert scalar.put({"load_position": grid[i]}) == 0
        np.testing.assert_array_equal(scalar.get(["load", "load_low", "load_high"]), curve[:, i])
    assert instance.get(["load_weights"]) == scalar.get(list(plant.load.names))
    weights = ("start.load_weights", "load_weights")
    assert [three.variables[name].size for name in weights] == [len(plant.load.names)] * 2
    places = (ctypes.c_uint * 1)(three.variables["curve.load"].place)
    few = (ctypes.c_double * 3)()
    assert instance.call("GetFloat64", places, ctypes.c_size_t(1), few, ctypes.c_size_t(3)) == 3


def test_fmi_3_refuses_what_it_does_not_have_with_a_sentence(made):
    three, sentences = compiled(made("observer", 3)), []
    logger = LOGGER(lambda _, status, category, text: sentences.append((status, category, text)))
    instance = three.instance(logger)
    refused = template("fmi3.j2", "clutchid.exports").module.refused
    assert len(refused) == 54
    nothing = ctypes.c_size_t(0)
    for function, arguments, reason in refused:
        several = [ctypes.c_size_t(1 if argument == "size_t n" else 0) for argument in arguments]
        sentences.clear()
        assert instance.call(function, *several) == 3
        assert sentences == [(3, b"logStatusError", reason.encode())]
        if "size_t n" in arguments:
            assert instance.call(function, *[nothing] * len(arguments)) == 0
    for kind in ("ModelExchange", "ScheduledExecution"):
        more = [None] * (3 if kind == "ScheduledExecution" else 0)
        instantiate = getattr(three.library, f"fmi3Instantiate{kind}")
        assert instantiate(b"it", three.token.encode(), None, 0, 1, None, logger, *more) is None
        assert b"for co-simulation only" in sentences[-1][2]
    assert three.instantiated(three.token, logger, events=1) is None


def test_units_are_products_of_base_units(modelled):
    units = {
        unit.attrib["name"]: unit[0].attrib for unit in described(modelled.content).findall("UnitDefinitions/Unit")
    }
    assert units["Pa"] == {"kg": "1", "m": "-1", "s": "-2"}
    assert units["m³/(Pa·s)"] == {"kg": "-1", "m": "4", "s": "1"}


def test_the_same_calibration_gives_the_same_bytes_and_another_one_another_guid(made, plant):
    modelled = made("model", 2)
    assert model_fmu(plant).content == modelled.content
    other = described(model_fmu(plant.replace(F_C=plant.parameters.F_C * 1.01)).content)
    assert other.attrib["guid"] != modelled.token


def test_without_a_compiler_an_fmu_has_only_sources(monkeypatch, plant):
    monkeypatch.setattr(fmu, "compiler", lambda: None)
    monkeypatch.setattr(fmu, "find_spec", lambda name: None)
    content = model_fmu(plant).content
    assert platforms(content) == ()
    assert described(content).findall("CoSimulation/SourceFiles/File")


def test_a_compiler_that_fails_is_an_error_with_its_words(plant, modules, made):
    compiled(made("observer", 2))
    estimator = observer(plant)
    broken = {**modules, "clutch": replace(modules["clutch"], source="int x = unknown_name;\n")}
    with pytest.raises(ExportError, match="unknown_name"):
        observer_fmu(estimator, start(estimator), STYLE, broken)


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for ziglang is a script")
def test_a_build_for_windows_that_fails_is_a_note_and_the_rest_is_kept(monkeypatch, plant, tmp_path):
    present = platforms(model_fmu(plant).content)
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho 'warning: x' >&2; echo 'error: unable to open cache.' >&2; exit 1\n")
    python.chmod(0o755)
    monkeypatch.setattr(fmu.sys, "executable", str(python))
    monkeypatch.setattr(fmu, "find_spec", lambda name: True)
    exported = model_fmu(plant)
    assert platforms(exported.content) == tuple(platform for platform in present if "win" not in platform)
    reason = "ziglang, which compiles it, fails: error: unable to open cache."
    assert f"x.fmu has no binary for 64-bit Windows: {reason}" in missing_parts("x.fmu", exported)


@pytest.mark.parametrize("header", ["clutchid", "fmpy"])
def test_its_sources_compile_without_a_warning(runs, header, tmp_path):
    if header == "fmpy":  # that of the standard
        fmpy = pytest.importorskip("fmpy", reason="fmpy, which has the standard's headers, is not installed")
        shutil.copytree(Path(fmpy.__file__).parent / "c-code", tmp_path / "headers")
    else:
        (tmp_path / "headers").mkdir()
        name = f"fmi{runs.version}Functions.h"
        (tmp_path / "headers" / name).write_text(template(f"{name}.j2", "clutchid.exports").render())
    sources = sorted(str(file) for file in (runs.folder / "sources").glob("*_fmu.c"))
    options = [*STRICT, "-O1", f"-I{tmp_path / 'headers'}", "-c", "-o", str(tmp_path / "fmu.o")]
    process = subprocess.run([path_of("cc"), *options, *sources], capture_output=True, text=True, check=False)
    assert process.stderr == ""


def test_its_library_has_every_function_of_the_standard_and_no_other(runs):
    header = template(f"fmi{runs.version}Functions.h.j2", "clutchid.exports").render()
    functions = set(re.findall(r"FMI[23]_Export [\w ]+\*?\b(fmi[23]\w+)\(", header))
    assert len(functions) == {2: 44, 3: 75}[runs.version]
    assert all(hasattr(runs.library, name) for name in functions)
    assert not hasattr(runs.library, f"{runs.name}_model_step")


def test_steps_of_the_observer_are_those_of_the_replay(observing, modules, inputs):
    n = round(SECONDS / STEP)
    replay = template("replay.c.j2", "clutchid.exports")
    folder = observing.folder / "sources"
    names = list(OUTPUTS)
    values = {"name": "clutch", "real": "double", "positions": [5e-3], "begins_us": 0, "outputs": names}
    (folder / "replay.c").write_text(replay.render(values))
    files = [str(folder / f"{stem}.c") for stem in ("replay", *modules)]
    subprocess.run([path_of("cc"), "-std=c99", "-O0", "-o", str(folder / "replay"), *files, "-lm"], check=True)
    columns = [inputs[name][:n] for name in ("position_measured", "duty_supply", "duty_exhaust")]
    samples = np.column_stack([*columns, np.full((n, 2), np.nan), np.where(np.arange(n) > 0, 1000.0, 0.0)])
    process = subprocess.run([str(folder / "replay")], input=samples.tobytes(), capture_output=True, check=True)
    replayed = np.frombuffer(process.stdout)
    instance = observing.instance().begin(load_position=5e-3)
    steps = instance.follow(inputs, names, 0, n)
    np.testing.assert_array_equal(steps, replayed[: len(names) * n].reshape(n, -1))
    load = replayed[len(names) * n :][:3]
    np.testing.assert_array_equal(instance.get(["load", "load_low", "load_high"]), load)
    assert np.isfinite(steps[:, 0]).all()


def test_an_observer_takes_a_sample_a_millisecond_whatever_the_step(observing, inputs):
    whole = observing.instance().begin().follow(inputs, ["pressure_a", "load"], 0, 500)
    parts = observing.instance().begin()
    for k in range(500):
        parts.put({name: float(values[k]) for name, values in inputs.items()})
        assert [parts.step(k * STEP + i * STEP / 4, STEP / 4) for i in range(4)] == [0] * 4
    np.testing.assert_array_equal(parts.get(["pressure_a", "load"]), whole[-1])


@pytest.mark.parametrize("step", [2 * STEP, 0.01, 0.02])
def test_an_observer_refuses_a_step_that_holds_its_inputs_for_several_samples(observing, inputs, step):
    instance = observing.instance().begin()
    assert instance.step(0.0, step) == 3
    assert instance.step(0.0, STEP * (1 + 1e-9)) == 0  # as an importer counts its own time
    assert "steps of at most 0.001 s" in str(described(observing.content).get("description"))


def test_a_parameter_that_adapts_may_begin_elsewhere(made):
    observing = compiled(made("observer", 2))
    name = next(name for name in observing.variables if name.startswith("start.theta_9"))
    (usual, load), weight = observing.instance().begin().get([name, "load"]), name.removeprefix("start.")
    moved = observing.instance().begin(**{name.replace(".", "__"): usual * 1.01})
    assert moved.get([weight])[0] == pytest.approx(usual * 1.01, rel=1e-12)
    assert observing.instance().begin().get([weight, "load"]) == [usual, load]


@pytest.mark.parametrize("model", ["energy-balance-stribeck", "isothermal"])
def test_steps_of_the_model_are_those_of_a_simulation(model, plant, inputs, tmp_path):
    actuator = replace(plant, model=model).replace(T_pwm=5e-3 if model != "isothermal" else 0.0, s_pwm=0.3e-3)
    exported = unpacked(model_fmu(actuator, "plant").content, tmp_path)
    compiled(exported)
    n = round(SECONDS / STEP)
    duties = given(exported, inputs)
    log = Log(np.arange(n) * STEP, {name: values[:n] for name, values in duties.items()})
    simulated = simulate(actuator, log).log
    instance = exported.instance().begin()
    names = ["position", "velocity", "pressure_a", "pressure_b"]
    steps = np.array([instance.get(names), *instance.follow(duties, names, 0, n - 1)])
    for name, values in zip(names, steps.T, strict=True):
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
    exported, n = unpacked(model_fmu(Actuator(model=element)).content, tmp_path), 500
    assert {"K_2", "z_2"} <= set(exported.variables)
    duties = given(compiled(exported), inputs)
    log = Log(np.arange(n) * STEP, {name: values[:n] for name, values in duties.items()})
    simulated = simulate(Actuator(model=element), log).log
    steps = exported.instance().begin().follow(duties, ["position", "z_2"], 0, n - 1)
    np.testing.assert_allclose(steps[:, 0], simulated["position"][1:], rtol=0, atol=1e-12)


def test_a_model_takes_other_parameters_and_another_start(modelled, plant):
    compiled(modelled)
    instance = modelled.instance().begin(start__position=0.01, start__pressure_a=4e5, P_0=1.0e5)
    assert instance.get(["position", "pressure_a", "pressure_b"]) == [0.01, 4e5, 1.0e5]
    before = instance.get(["load"])[0]
    theta = 1.1 * np.array(plant.load.theta)
    weights = {"load_weights": theta} if modelled.version == 3 else dict(zip(plant.load.names, theta, strict=True))
    assert instance.put(weights) == 0
    assert instance.get(["load"])[0] == pytest.approx(1.1 * before, rel=1e-9)  # at once
    assert instance.step(0.0, 1e-6) == 0
    assert instance.get(["load"])[0] == pytest.approx(1.1 * before, rel=1e-3)


@pytest.mark.parametrize("valves", ["3/2", "supply"])
def test_a_valve_that_does_not_exist_has_no_input(plant, tmp_path, valves):
    exported = compiled(unpacked(model_fmu(replace(plant, equipment=Equipment(valves=valves))).content, tmp_path))
    assert "duty_exhaust" not in exported.variables
    instance = exported.instance().begin(start__position=0.01, start__pressure_a=4e5)
    assert [instance.step(k * STEP) for k in range(200)] == [0] * 200
    assert (instance.get(["pressure_a"])[0] < 1.5e5) == (valves == "3/2"), "a three-way valve vents where it is closed"


def test_a_state_that_is_restored_goes_on_as_before(runs, inputs):
    used, names, instance = given(runs, inputs), outputs_of(runs), runs.instance().begin()
    instance.follow(used, names, 0, 700)
    state, size = ctypes.c_void_p(), ctypes.c_size_t()
    assert instance.call("GetFMUstate", ctypes.byref(state)) == 0
    assert instance.call("SerializedFMUstateSize", state, ctypes.byref(size)) == 0
    written = (ctypes.c_char * size.value)()
    assert instance.call("SerializeFMUstate", state, written, size) == 0
    on = instance.follow(used, names, 700, 1400)
    assert instance.call("SetFMUstate", state) == 0
    np.testing.assert_array_equal(instance.follow(used, names, 700, 1400), on)
    assert instance.call("FreeFMUstate", ctypes.byref(state)) == 0
    assert state.value is None
    other, read = runs.instance(), ctypes.c_void_p()
    assert other.call("DeSerializeFMUstate", written, size, ctypes.byref(read)) == 0
    assert other.call("SetFMUstate", read) == 0
    np.testing.assert_array_equal(other.follow(used, names, 700, 1400), on)
    written[0] = b"?"
    assert other.call("DeSerializeFMUstate", written, size, ctypes.byref(read)) == 3


def test_instances_do_not_disturb_each_other_and_a_reset_begins_anew(runs, inputs):
    used, names = given(runs, inputs), outputs_of(runs)
    alone = runs.instance().begin().follow(used, names, 0, 800)
    instance, two = runs.instance().begin(), runs.instance().begin()
    backwards = {name: values[::-1] for name, values in used.items()}
    both = [(instance.follow(used, names, k, k + 1)[0], two.follow(backwards, names, k, k + 1)[0]) for k in range(800)]
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
    assert runs.instantiated("{another}") is None
    assert runs.instantiated(runs.token, events=1) is None


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
    names = ["position", "pressure_a", "load", *(["curve.load"] if "curve.load" in runs.variables else [])]
    result = fmpy.simulate_fmu(str(file), start_time=0.0, stop_time=n * STEP, step_size=STEP, output_interval=STEP,
                               input=signals, output=names)  # fmt: skip
    rows = runs.instance().begin().follow(used, names, 0, n)
    recorded = np.column_stack([result[name][1:].reshape(n, -1) for name in names])
    np.testing.assert_allclose(recorded, rows, rtol=1e-6, atol=1e-9)


@pytest.mark.needs("wine64")
@pytest.mark.skipif(not find_spec("ziglang"), reason="ziglang is not installed")
def test_the_library_for_windows_gives_the_numbers_of_that_for_linux(runs, inputs, tmp_path):
    loader, zig = tmp_path / "loader.exe", (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu")
    subprocess.run([*zig, "-std=c99", "-O1", "-o", loader, Path(__file__).with_name("loader.c")], check=True)
    library = next((runs.folder / "binaries").glob(f"win64/{runs.name}.dll" if runs.version == 2 else "*windows/*.dll"))
    used, n = given(runs, inputs), 2000
    names = ["position", "velocity", "pressure_a", "load"]
    numbers = [str(runs.variables[name].place) for name in (*used, *names)]
    samples = "\n".join(" ".join(float(values[k]).hex() for values in used.values()) for k in range(n))
    process = subprocess.run(
        [path_of("wine64"), loader, library, str(runs.version), runs.token, str(len(used)), *numbers],
        input=samples, capture_output=True, text=True, check=False, env={**os.environ, "WINEDEBUG": "-all"},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    on_windows = np.array([[float.fromhex(value) for value in line.split()] for line in process.stdout.splitlines()])
    on_linux = runs.instance().begin().follow(used, names, 0, n)
    assert on_windows.shape == on_linux.shape
    for value, expected in zip(on_windows.T, on_linux.T, strict=True):  # the C libraries differ in the last bit
        np.testing.assert_allclose(value, expected, rtol=0, atol=1e-12 * np.nanmax(np.abs(expected)))
