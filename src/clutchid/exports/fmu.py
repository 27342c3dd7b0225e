"""Functional Mock-up Units, FMI 2.0 and 3.0 for co-simulation: an observer, and an actuator with its load."""

from __future__ import annotations

import hashlib
import io
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np

from clutchid.codegen.c99 import CSource, c99_source
from clutchid.codegen.language import C_DOUBLE
from clutchid.codegen.templates import template
from clutchid.errors import ExportError, install_command
from clutchid.exports.c99 import CStyle, compiler, source_files, state_notes
from clutchid.exports.data import carrier_us
from clutchid.exports.outputs import OUTPUTS
from clutchid.inference.filter.joint_parameters import value_in_si
from clutchid.inference.filter.setup import LEAST, MOST
from clutchid.log.states import STATES, State
from clutchid.messages import shortened
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels, system
from clutchid.model.equipment import Equipment
from clutchid.model.own.units import dimension_of
from clutchid.observer.by_stroke import curve_positions
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import FLAGS
from clutchid.observer.state import ObserverState
from clutchid.parameters import Row
from clutchid.simulation.inputs import ROUNDING
from clutchid.simulation.stiffness import MOST_SUBSTEPS, STABLE_STEP, stiffness
from clutchid.systems import is_linux64

Version = Literal[2, 3]
Kind = Literal["Real", "Integer", "Boolean"]
Causality = Literal["input", "output", "parameter", "local", "independent"]
Variability = Literal["continuous", "discrete", "tunable", "fixed"]

#: Longest interval with held inputs in a step of a model in s, as a control unit renews them.
_SAMPLE_TIME = 1e-3

#: Position in m at which an observer gives the load until another one is set: where the paper's load peaks.
_LOAD_POSITION = 8.5e-3

#: Date of every file in an FMU: the same calibration gives the same bytes.
DATE = (1980, 1, 1, 0, 0, 0)

_FLAGS_OF_COMPILER = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden", "-s")

#: Longest line of a compiler in a note.
_LONGEST_CAUSE = 160

#: Versions of FMI, and what they add to the name of a file.
FMUS: Mapping[Version, str] = MappingProxyType({2: "", 3: "_fmi3"})

#: Folders of binaries by version: of 64-bit Linux, and of 64-bit Windows.
_LINUX, _WINDOWS = {2: "linux64", 3: "x86_64-linux"}, {2: "win64", 3: "x86_64-windows"}


class Fmu(NamedTuple):
    """The content of an FMU, and why its library for Windows could not be compiled, empty where nothing was wrong."""

    content: bytes
    windows_failure: str = ""


class Array(NamedTuple):
    """An array of FMI 3.0; its elements are variables of FMI 2.0."""

    name: str
    description: str


#: Natural sizes by unit; 1 is that of a variable without a unit.
_NOMINALS = {row.unit: row.scale for row in reversed(tuple(STATES.values())) if row.unit != "1"} | {"N": 1e3}

WEIGHTS = Array("load_weights", "weights of the load")


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of an FMU in SI, or an element of an array.

    `start` is None where it is calculated; then it may have a `usual` value.
    """

    name: str
    description: str
    causality: Causality
    unit: str = "1"
    start: float | None = None
    variability: Variability = "continuous"
    low: float | None = None
    high: float | None = None
    kind: Kind = "Real"
    array: Array | None = None
    usual: float | None = None

    @property
    def set(self) -> str:
        """Who may set it, as C has it."""
        if self.causality not in ("input", "parameter"):
            return "never"
        return {"fixed": "before_steps", "tunable": "tunable"}.get(self.variability, "held")

    @property
    def nominal(self) -> float | None:
        """Natural size: that of its start or usual value, or of states of its unit."""
        return abs(self.start or self.usual or 0.0) or _NOMINALS.get(self.unit)


def observer_fmu(
    observer: Observer,
    state: ObserverState,
    style: CStyle,
    modules: Mapping[str, CSource],
    version: Version = 2,
) -> Fmu:
    """An observer as an FMU.

    It takes a sample every `Observer.spacing` s, the first one at the start, with the inputs at the beginning of a
    step; its outputs are those of the last sample. A longer step is refused: inputs that are held for longer than a
    sample make the load wrong. Parameters that adapt may begin elsewhere (``start.NAME``).

    Parameters
    ----------
    state
        What is known of the parameters that adapt at the start.
    modules
        The observer in C, as `clutchid.exports.c99.observer_c99` makes it with this state and style.
    version
        Of FMI: 2 for 2.0; 3 for 3.0, where the weights of the load are an array, and the load is given as a curve too.

    Raises
    ------
    ExportError
        If there is a C compiler, and it fails.
    """
    joint = observer.joint
    free = tuple(c.base for c in joint.coordinates)
    carrier = "c_pwm" in kernels(joint.mapped.actuator.model).INPUTS
    values = {
        "title": f"on-line observer of a clutch actuator, method {observer.method}, in {style.real}; "
        f"communication steps of at most {observer.spacing:g} s",
        "real": style.real,
        "fields": [name for name, output in OUTPUTS.items() if output.unit],
        "counts": [name for name, output in OUTPUTS.items() if not output.unit],
        "free": free,
        "curve": curve_positions(observer).size,
        "carrier_us": carrier_us(joint.mapped.actuator) if carrier else 0,
        "spacing": observer.spacing,
        "longest": observer.spacing,
        "failure": "",
    }
    variables, equipment = _of_observer(observer, state, version), observer.actuator.equipment
    return _fmu("observer", version, style.name, variables, equipment, modules, values)


def model_fmu(actuator: Actuator, name: str = "actuator", version: Version = 2) -> Fmu:
    """An actuator with its load as an FMU, in double.

    It does what `clutchid.simulation.simulate` does with a sample at every communication point. A step longer than the
    parameter ``sample_time`` has several intervals. It begins vented and at rest, Eq. (24), or as ``start.position``
    and ``start.pressure_a`` say.

    Parameters
    ----------
    name
        A C identifier: prefix of every name in C, and the FMU's model identifier.
    version
        Of FMI: 2 for 2.0; 3 for 3.0, where the weights of the load are an array.

    Raises
    ------
    ParameterError
        If the name is not a C identifier.
    ExportError
        If there is a C compiler, and it fails.
    """
    style = CStyle(name, "double")
    model = c99_source(replace(system(actuator.model), name=f"{style.name}_model"), notes=state_notes(actuator))
    load, rows = actuator.load, actuator.state_rows
    values = {
        "title": f"clutch actuator with its load, model {actuator.model}",
        "parameters": _parameters_of(actuator),
        "weights": load.names,
        "states": [_column(row) for row in rows.values()],
        "starts": {symbol: row.starts_at for symbol, row in rows.items() if row.starts_at},
        "p": list(zip(actuator.parameter_names, actuator.array().tolist(), strict=True)),
        "breakpoints": load.breakpoints.tolist(),
        "basis": load.coefficients.reshape(len(load.names), -1).tolist(),
        "carrier": "c_pwm" in kernels(actuator.model).INPUTS,
        "stable": STABLE_STEP,
        "most": MOST_SUBSTEPS,
        "rounding": ROUNDING,
        "spacing": _SAMPLE_TIME,
        "longest": 0.0,
        "failure": "states are not finite, or the parameters need too many integration steps.",
    }
    return _fmu("model", version, style.name, _of_model(actuator), actuator.equipment, {f"{name}_model": model}, values)


def platforms(fmu: bytes) -> tuple[str, ...]:
    """Platforms for which an FMU has a binary, such as ``linux64``; without its own an importer compiles sources."""
    with zipfile.ZipFile(io.BytesIO(fmu)) as archive:
        return tuple(sorted({name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}))


def missing_parts(file: str, fmu: Fmu) -> tuple[str, ...]:
    """A sentence for each binary that an FMU, written to a file, could have and lacks."""
    present = set(platforms(fmu.content))
    absent = f"is not installed: {install_command('export')}"
    failed = f"fails: {fmu.windows_failure}" if fmu.windows_failure else absent
    reasons = (
        (_LINUX, "for 64-bit Linux: there is no C compiler for it on this machine"),
        (_WINDOWS, f"for 64-bit Windows: ziglang, which compiles it, {failed}"),
    )
    return tuple(f"{file} has no binary {reason}." for names, reason in reasons if present.isdisjoint(names.values()))


def _of_observer(observer: Observer, state: ObserverState, version: Version) -> list[Variable]:
    adapting = _adapting(observer, state)
    before = Array(f"start.{WEIGHTS.name}", f"{WEIGHTS.description}, at the start")
    outputs = [
        Variable(name, output.meaning, "output", output.unit or "1", variability="discrete",
                 kind="Real" if output.unit else "Integer")
        for name, output in OUTPUTS.items()
    ]  # fmt: skip
    return [
        Variable("position_measured", "position as the sensor shows it; NaN if missing", "input", "m", 0.0),
        *_duties(observer.actuator.equipment),
        Variable("supply_pressure", "supply pressure, absolute; 0 if not measured", "input", "Pa", 0.0),
        Variable("air_temperature", "temperature of the air; 0 if not measured", "input", "K", 0.0),
        Variable("load_position", "position at which the load is given", "parameter", "m", _LOAD_POSITION, "tunable"),
        *(
            replace(v, name=f"start.{v.name}", description=f"{v.description}, at the start", array=v.array and before)
            for v in adapting
        ),
        *(
            Variable(v.name, v.description, "local", v.unit, variability="discrete", array=v.array, usual=v.start)
            for v in adapting
        ),
        Variable("load", "load of the clutch at load_position", "output", "N", variability="discrete"),
        Variable("load_low", "lower end of its 95 % interval", "output", "N", variability="discrete"),
        Variable("load_high", "upper end of its 95 % interval", "output", "N", variability="discrete"),
        *(_curves(observer) if version == 3 else ()),
        *outputs,
        *(
            Variable(f"flag.{name}", meaning, "output", variability="discrete", kind="Boolean")
            for name, meaning in FLAGS.items()
        ),
    ]


def _curves(observer: Observer) -> Iterator[Variable]:
    """Arrays of the load over the stroke: positions, which an importer may change, load and ends of its interval."""
    grid = curve_positions(observer).tolist()
    where = Array("curve.position", "positions of the load curve")
    for i, position in enumerate(grid, 1):
        yield Variable(f"curve.position.{i}", "", "parameter", "m", position, "tunable", array=where)
    for part, meaning in (
        ("load", "load of the clutch at curve.position"),
        ("load_low", "lower ends of its 95 % interval"),
        ("load_high", "upper ends of its 95 % interval"),
    ):
        array = Array(f"curve.{part}", meaning)
        for i in range(1, len(grid) + 1):
            yield Variable(f"curve.{part}.{i}", "", "output", "N", variability="discrete", array=array)


def _adapting(observer: Observer, state: ObserverState) -> list[Variable]:
    """Parameters that adapt, with their start values in a state."""
    joint, actuator = observer.joint, observer.joint.mapped.actuator
    variables = []
    for coordinate, row, theta in zip(joint.coordinates, joint.free.numbers, state.theta.tolist(), strict=True):
        name = coordinate.base
        start, low, high = (value_in_si(row, at) for at in (theta, row[LEAST], row[MOST]))
        meaning, unit = _meaning(actuator, name), actuator.unit(name)
        array = WEIGHTS if name in actuator.load.names else None
        variables.append(Variable(name, meaning, "parameter", unit, start, "fixed", low, high, array=array))
    return variables


def _of_model(actuator: Actuator) -> list[Variable]:
    rows = actuator.rows
    return [
        *_duties(actuator.equipment),
        Variable("start.position", "position of the piston at the start", "parameter", "m", 0.0, "fixed"),
        Variable("start.pressure_a", "pressure in chamber A at the start, absolute; 0 for P_0", "parameter", "Pa", 0.0,
                 "fixed"),
        Variable("sample_time", "longest interval with held inputs within a step", "parameter", "s", _SAMPLE_TIME,
                 "fixed", 1e-6),
        Variable("stiffness", "fastest mode that integration steps follow", "parameter", "1/s",
                 stiffness(actuator), "tunable", 0.0),
        *(
            Variable(name, rows[name].meaning, "parameter", rows[name].unit, actuator.value(name), "tunable",
                     *_range(rows[name]))
            for name in _parameters_of(actuator)
        ),
        *(
            Variable(name, _meaning(actuator, name), "parameter", actuator.load.unit, value, "tunable", array=WEIGHTS)
            for name, value in zip(actuator.load.names, actuator.load.theta, strict=True)
        ),
        *(
            Variable(_column(row), row.meaning, "output" if row.unit in _OUTPUT or name == "y" else "local", row.unit)
            for name, row in actuator.state_rows.items()
        ),
        Variable("load", "load of the clutch on the piston", "output", "N"),
    ]  # fmt: skip


#: Units of the states of a model that are outputs, beside the position.
_OUTPUT = ("m/s", "Pa", "K")


def _column(row: State) -> str:
    """Name of a state's variable: that of its column, which has a unit behind it in own models."""
    return row.column.partition(" ")[0]


def _parameters_of(actuator: Actuator) -> list[str]:
    """Parameters that act on the states, in the order of the model."""
    starts = {row.starts_at for row in actuator.state_rows.values()}
    carrier = {"T_pwm"} if "c_pwm" in kernels(actuator.model).INPUTS else set()
    return [name for name in actuator.parameter_names if name in actuator.in_equations | starts | carrier]


def _range(row: Row) -> tuple[float | None, float | None]:
    return tuple(float(end) if np.isfinite(end) else None for end in (row.low, row.high))  # type: ignore[return-value]


def _meaning(actuator: Actuator, name: str) -> str:
    if name in actuator.load.names:
        return f"weight {actuator.load.names.index(name) + 1} of the load"
    return actuator.row(name).meaning


def _duties(equipment: Equipment) -> list[Variable]:
    return [
        Variable(name, f"duty cycle of the {name.removeprefix('duty_')} valve", "input", "1", 0.0, low=0.0, high=1.0)
        for name in equipment.recorded
    ]


def _duties_in_c(equipment: Equipment) -> list[str]:
    """Both duty cycles of the model, as `Equipment.driven` makes them of the recorded ones."""
    recorded = equipment.recorded
    other = f"(1.0 - state->real[real_{recorded[0]}])" if equipment.valves == "3/2" else "0.0"
    names = ("duty_supply", "duty_exhaust")
    return [f"state->real[real_{name}]" if name in recorded else other for name in names]


def _fmu(
    part: str,
    version: Version,
    name: str,
    variables: Sequence[Variable],
    equipment: Equipment,
    modules: Mapping[str, CSource],
    values: Mapping[str, Any],
) -> Fmu:
    """An FMU of variables and the C modules that its wrapper calls."""
    if version == 3:
        variables = [Variable("time", "time of the last communication point", "independent", "s"), *variables]
    kinds: tuple[Kind, ...] = ("Real", "Integer", "Boolean")
    by_kind = {kind: [v for v in variables if v.kind == kind] for kind in kinds}
    in_order = [v for rows in by_kind.values() for v in rows]
    sources = source_files(modules)
    wrapper = f"{name}_fmu.c"
    units = sorted({v.unit for v in variables} - {"1"})
    filled = {
        **values,
        "version": version,
        "name": name,
        "number": C_DOUBLE.print,
        "variables": by_kind,
        "arrays": [
            list(rows) for _, rows in groupby(in_order, lambda v: (v.array if version == 3 else None) or v.name)
        ],
        "duties": _duties_in_c(equipment),
        "units": {unit: _base_units(unit) for unit in units},
        "files": [wrapper, *(file for file in sources if file.endswith(".c"))],
    }
    described = {
        "modelDescription.xml": f"modelDescription{version}.xml.j2",
        f"sources/{wrapper}": f"fmu_{part}.c.j2",
        **({"sources/buildDescription.xml": "buildDescription.xml.j2"} if version == 3 else {}),
    }

    def texts(guid: str) -> dict[str, str]:
        made = {file: template(of, "clutchid.exports").render(filled, guid=guid) for file, of in described.items()}
        return made | {f"sources/{file}": text for file, text in sources.items()}

    files = {file: text.encode() for file, text in texts(_guid(texts("").values())).items()}
    in_c = {Path(file).name: text for file, text in files.items() if file.endswith((".c", ".h"))}
    binaries, failure = _binaries(name, version, in_c)
    return Fmu(_zipped(files | binaries), failure)


def _base_units(unit: str) -> dict[str, int]:
    exponents = dimension_of(unit) or ()
    return dict(zip(("kg", "m", "s", "K"), map(int, exponents), strict=True))


def _guid(texts: Iterable[str]) -> str:
    digest = hashlib.sha256("\0".join(texts).encode()).digest()
    return f"{{{uuid.UUID(bytes=digest[:16])}}}"


def _zipped(files: Mapping[str, bytes]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.external_attr = 0o644 << 16
            entry.create_system = 3
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return content.getvalue()


def _builds(name: str, version: Version) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Libraries and their compilers: for Linux where this machine can compile it, for Windows by ziglang."""
    cc = compiler()
    if cc is not None and is_linux64():
        yield f"{_LINUX[version]}/{name}.so", (cc,)
    if find_spec("ziglang"):
        zig = (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu")
        yield f"{_WINDOWS[version]}/{name}.dll", zig


def _binaries(name: str, version: Version, sources: Mapping[str, bytes]) -> tuple[dict[str, bytes], str]:
    """Shared libraries of sources by name.

    A second text says why the library for Windows, which is of use to others only, could not be made.

    Raises
    ------
    ExportError
        If the compiler of this machine fails.
    """
    header = f"fmi{version}Functions.h"
    texts = {**sources, header: template(f"{header}.j2", "clutchid.exports").render().encode()}
    flags = (*_FLAGS_OF_COMPILER, f"-DFMI{version}_OVERRIDE_FUNCTION_PREFIX")
    files: dict[str, bytes] = {}
    for file, command in _builds(name, version):
        try:
            files[f"binaries/{file}"] = _compiled([*command, *flags], texts, Path(file).name)
        except ExportError as error:
            if not file.endswith(".dll"):
                raise
            return files, _cause(str(error))
    return files, ""


def _cause(output: str) -> str:
    """The line of what a compiler says that has its error, or its last one."""
    lines = [line.strip().rstrip(".") for line in output.splitlines() if line.strip()]
    return shortened(next((line for line in lines if "error:" in line.casefold()), lines[-1]), _LONGEST_CAUSE)


def _compiled(command: Sequence[str], texts: Mapping[str, bytes], name: str) -> bytes:
    """A library of sources."""
    with TemporaryDirectory() as folder:
        for file, text in texts.items():
            (Path(folder) / file).write_bytes(text)
        whole = [*command, "-o", name, *sorted(file for file in texts if file.endswith(".c")), "-lm"]
        run = subprocess.run(whole, cwd=folder, capture_output=True, encoding="utf-8", errors="replace", check=False)
        if run.returncode:
            raise ExportError(f"{command[0]} fails with the FMU:\n{(run.stderr or run.stdout).strip()}")
        return (Path(folder) / name).read_bytes()
