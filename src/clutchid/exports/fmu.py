"""Functional Mock-up Units, FMI 2.0 for co-simulation: an observer, and an actuator with its load."""

from __future__ import annotations

import hashlib
import io
import subprocess
import uuid
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from clutchid.codegen.c99 import CSource, c99_source
from clutchid.codegen.language import C_DOUBLE
from clutchid.codegen.templates import template
from clutchid.errors import ExportError
from clutchid.exports.c99 import CStyle, compiler, source_files, state_notes
from clutchid.exports.data import carrier_us
from clutchid.exports.outputs import OUTPUTS
from clutchid.inference.filter.joint_parameters import value_in_si
from clutchid.inference.filter.setup import LEAST, MOST
from clutchid.log.states import State
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels, system
from clutchid.model.equipment import Equipment
from clutchid.model.own.units import dimension_of
from clutchid.observer.health import FLAGS
from clutchid.observer.observer import Observer
from clutchid.observer.state import ObserverState
from clutchid.parameters import Row
from clutchid.simulation.inputs import ROUNDING
from clutchid.simulation.stiffness import MOST_SUBSTEPS, STABLE_STEP, stiffness
from clutchid.systems import is_linux64

Kind = Literal["Real", "Integer", "Boolean", "String"]
Causality = Literal["input", "output", "parameter", "local"]
Variability = Literal["continuous", "discrete", "tunable", "fixed"]

#: Longest interval with held inputs in a step of a model in s, as a control unit renews them.
SAMPLE_TIME = 1e-3

#: Position in m at which an observer gives the load until another one is set: where the paper's load peaks.
LOAD_POSITION = 8.5e-3

#: Date of every file in an FMU: the same calibration gives the same bytes.
DATE = (1980, 1, 1, 0, 0, 0)

FLAGS_OF_COMPILER = (
    *("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-s"),
    "-DFMI2_OVERRIDE_FUNCTION_PREFIX",
)


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of an FMU in SI; `start` is None where it is calculated.

    Its value reference is its place among those of its kind.
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

    @property
    def set(self) -> str:
        """When an importer may set it, as C has it."""
        if self.causality not in ("input", "parameter"):
            return "never"
        return "before_steps" if self.variability == "fixed" else "always"


def observer_fmu(observer: Observer, state: ObserverState, style: CStyle, modules: Mapping[str, CSource]) -> bytes:
    """An observer as an FMU: the file's content.

    It takes a sample every `Observer.spacing` s, the first one at the start, with the inputs at the beginning of a
    step; its outputs are those of the last sample. A longer step is refused: inputs that are held for longer than a
    sample make the load wrong. Parameters that adapt may begin elsewhere (``start.NAME``).

    Parameters
    ----------
    state
        What is known of the parameters that adapt at the start.
    modules
        The observer in C, as `clutchid.exports.c99.observer_c99` makes it with this state and style.

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
        "carrier_us": carrier_us(joint.mapped.actuator) if carrier else 0,
        "spacing": observer.spacing,
        "longest": observer.spacing,
        "failure": "",
    }
    return _fmu("observer", style.name, _of_observer(observer, state), observer.actuator.equipment, modules, values)


def model_fmu(actuator: Actuator, name: str = "actuator") -> bytes:
    """An actuator with its load as an FMU, in double: the file's content.

    It does what `clutchid.simulation.simulate` does with a sample at every communication point. A step longer than the
    parameter ``sample_time`` has several intervals. It begins vented and at rest, Eq. (24), or as ``start.position``
    and ``start.pressure_a`` say.

    Parameters
    ----------
    name
        A C identifier: prefix of every name in C, and the FMU's model identifier.

    Raises
    ------
    ParameterError
        If the name is no C identifier.
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
        "spacing": SAMPLE_TIME,
        "longest": 0.0,
        "failure": "states are not finite, or the parameters need too many integration steps.",
    }
    return _fmu("model", style.name, _of_model(actuator), actuator.equipment, {f"{name}_model": model}, values)


def platforms(fmu: bytes) -> tuple[str, ...]:
    """Platforms for which an FMU has a binary, such as ``linux64``; without one an importer compiles its sources."""
    with zipfile.ZipFile(io.BytesIO(fmu)) as archive:
        return tuple(sorted({name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}))


def _of_observer(observer: Observer, state: ObserverState) -> list[Variable]:
    adapting = _adapting(observer, state)
    outputs = [
        Variable(name, output.meaning, "output", output.unit or "1", variability="discrete",
                 kind="Real" if output.unit else "Integer")
        for name, output in OUTPUTS.items()
    ]  # fmt: skip
    return [
        Variable("position_measured", "position as the sensor shows it; NaN for none", "input", "m", 0.0),
        *_duties(observer.actuator.equipment),
        Variable("supply_pressure", "supply pressure, absolute; 0 for none", "input", "Pa", 0.0),
        Variable("load_position", "position of the load that is given", "parameter", "m", LOAD_POSITION, "tunable"),
        *(replace(v, name=f"start.{v.name}", description=f"{v.description}, at the start") for v in adapting),
        *(Variable(v.name, v.description, "local", v.unit, variability="discrete") for v in adapting),
        Variable("load", "load of the clutch at load_position", "output", "N", variability="discrete"),
        Variable("load_low", "lower end of its 95 % interval", "output", "N", variability="discrete"),
        Variable("load_high", "upper end of its 95 % interval", "output", "N", variability="discrete"),
        *outputs,
        *(
            Variable(f"flag.{name}", meaning, "output", variability="discrete", kind="Boolean")
            for name, meaning in FLAGS.items()
        ),
    ]


def _adapting(observer: Observer, state: ObserverState) -> list[Variable]:
    """Parameters that adapt, with their start values in a state."""
    joint, actuator = observer.joint, observer.joint.mapped.actuator
    variables = []
    for coordinate, row, theta in zip(joint.coordinates, joint.free.numbers, state.theta.tolist(), strict=True):
        name = coordinate.base
        start, low, high = (value_in_si(row, at) for at in (theta, row[LEAST], row[MOST]))
        meaning, unit = _meaning(actuator, name), actuator.unit(name)
        variables.append(Variable(name, meaning, "parameter", unit, start, "fixed", low, high))
    return variables


def _of_model(actuator: Actuator) -> list[Variable]:
    rows = actuator.rows
    return [
        *_duties(actuator.equipment),
        Variable("start.position", "position of the piston at the start", "parameter", "m", 0.0, "fixed"),
        Variable("start.pressure_a", "pressure in chamber A at the start, absolute; 0 for P_0", "parameter", "Pa", 0.0,
                 "fixed"),
        Variable("sample_time", "longest interval with held inputs within a step", "parameter", "s", SAMPLE_TIME,
                 "fixed", 1e-6),
        Variable("stiffness", "fastest mode that integration steps follow", "parameter", "1/s",
                 stiffness(actuator), "tunable", 0.0),
        *(
            Variable(name, rows[name].meaning, "parameter", rows[name].unit, actuator.value(name), "tunable",
                     *_range(rows[name]))
            for name in _parameters_of(actuator)
        ),
        *(
            Variable(name, _meaning(actuator, name), "parameter", actuator.load.unit, value, "tunable")
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
    name: str,
    variables: Sequence[Variable],
    equipment: Equipment,
    modules: Mapping[str, CSource],
    values: Mapping[str, Any],
) -> bytes:
    """The content of an FMU of variables and the C modules that its wrapper calls."""
    kinds: tuple[Kind, ...] = ("Real", "Integer", "Boolean", "String")
    by_kind = {kind: [v for v in variables if v.kind == kind] for kind in kinds}
    in_order = [v for rows in by_kind.values() for v in rows]
    sources = source_files(modules)
    wrapper = f"{name}_fmu.c"
    units = sorted({v.unit for v in variables} - {"1"})
    filled = {
        **values,
        "name": name,
        "number": C_DOUBLE.print,
        "variables": by_kind,
        "duties": _duties_in_c(equipment),
        "outputs": [i for i, v in enumerate(in_order, 1) if v.causality == "output"],
        "units": {unit: _base_units(unit) for unit in units},
        "files": [wrapper, *(file for file in sources if file.endswith(".c"))],
    }

    def texts(guid: str) -> dict[str, str]:
        rendered = {"modelDescription.xml": "modelDescription.xml.j2", f"sources/{wrapper}": f"fmu_{part}.c.j2"}
        made = {file: template(of, "clutchid.exports").render(filled, guid=guid) for file, of in rendered.items()}
        return made | {f"sources/{file}": text for file, text in sources.items()}

    files = {file: text.encode() for file, text in texts(_guid(texts("").values())).items()}
    binary = _linux_binary({Path(file).name: text for file, text in files.items() if file.startswith("sources/")})
    return _zipped(files | ({f"binaries/linux64/{name}.so": binary} if binary else {}))


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


def _linux_binary(sources: Mapping[str, bytes]) -> bytes | None:
    """The shared library of sources by name; None where this machine is another platform, or has no compiler.

    Raises
    ------
    ExportError
        If the compiler fails.
    """
    cc = compiler()
    if cc is None or not is_linux64():
        return None
    header = template("fmi2Functions.h.j2", "clutchid.exports").render()
    with TemporaryDirectory() as folder:
        for name, text in {**sources, "fmi2Functions.h": header.encode()}.items():
            (Path(folder) / name).write_bytes(text)
        names = sorted(name for name in sources if name.endswith(".c"))
        command = [cc, *FLAGS_OF_COMPILER, "-o", "fmu.so", *names, "-lm"]
        compiled = subprocess.run(
            command, cwd=folder, capture_output=True, encoding="utf-8", errors="replace", check=False
        )
        if compiled.returncode:
            raise ExportError(f"{cc} cannot compile the FMU:\n{compiled.stderr.strip()}")
        return (Path(folder) / "fmu.so").read_bytes()
