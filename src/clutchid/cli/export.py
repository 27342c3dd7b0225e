"""``clutchid export``: an observer for a control unit, a simulator and a measurement tool."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import (
    DONE,
    FILES,
    SEARCH,
    FileOptions,
    Flag,
    OutOption,
    OutputFlag,
    guarded,
    print_json,
    print_written,
    progress_bar,
)
from clutchid.documents.console import put, say
from clutchid.verbs.options import USUAL_FILES

if TYPE_CHECKING:
    from clutchid.verbs.exporting import Export


@guarded
def export(
    calibration: Path,
    /,
    *,
    out: OutOption,
    to: str = "c",
    method: Annotated[Literal["joint", "states", "paper"], SEARCH] = "joint",
    real: Literal["float", "double"] = "float",
    rates: Literal["one", "two"] = "one",
    name: str = "clutch",
    resume: Annotated[Path | None, FILES] = None,
    check: Annotated[list[Path] | None, Parameter(consume_multiple=True), FILES] = None,
    model: Flag = False,
    supply_std: Annotated[float | None, SEARCH] = None,
    supply_sensor_std: Annotated[float | None, SEARCH] = None,
    files: FileOptions = USUAL_FILES,
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Write the observer of a calibration as C99 for a control unit, and compare it with the one in Python.

    Parameters
    ----------
    calibration
        Parameter file (TOML), as written by `clutchid calibrate --save`.
    out
        Folder to write; it is created.
    to
        Targets, comma-separated: c, fmu2, fmu3, matlab, a2l, dbc.
    method
        Method of the observer, as in `clutchid observe`.
    real
        Type of every number in C.
    rates
        one: everything in the fast task; two: corrections in a slower task.
    name
        Prefix of every name in C.
    resume
        State of an observer, as written by `clutchid observe --save`: the export continues from this state.
    check
        Recordings on which C and Python are compared; by default a short simulated drive.
    model
        Write the actuator with its load as an FMU too, for `--to fmu2` or `fmu3`.
    supply_std
        Standard deviation of a supply pressure that is not recorded, as in `clutchid observe`.
    supply_sensor_std
        The same for a recorded supply pressure: 0.02 to 0.03 for a bus signal.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.verbs import exporting
    from clutchid.verbs.start import content_of

    logs = files.reading(check).read(content_of(calibration).actuator) if check else ()
    slow = "fmu" in to and find_spec("ziglang")
    with progress_bar("export: the first FMU for Windows takes some minutes" if slow else "export"):
        export = exporting.export(
            calibration, out, to=to, method=method, real=real, rates=rates, name=name, resume=resume, check=logs,
            model=model, supply_std=supply_std, supply_sensor_std=supply_sensor_std,
        )  # fmt: skip
    _answer(export, json)
    return DONE


def _answer(bundle: Export, json: bool) -> None:
    if json:
        entries = [{
            "recording": parity.recording, "samples": parity.samples, "holds": parity.holds(bundle.style),
            "theta": parity.theta, "load": parity.load, "pressure_a_rms_Pa": parity.pressure,
        } for parity in bundle.parities]  # fmt: skip
        print_json({
            "status": "ok" if bundle.holds else "warning",
            "message": bundle.message,
            "files": list(bundle.files),
            "parity": next(iter([entry for entry in entries if not entry["holds"]] or entries), None),
            "parities": entries,
            "warnings": list(bundle.notes),
        })  # fmt: skip
        return
    say(bundle.notes)
    put(bundle.message)
    print_written(bundle.folder)
