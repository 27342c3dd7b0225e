"""`export`: the on-line observer of a calibration as C99, FMU, A2L, DBC and for Simulink."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.arguments import checked
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.estimation.result import Fit
from clutchid.exports.exporting import Export
from clutchid.verbs.reading import LogOrPath, reading_of
from clutchid.verbs.start import CalibrationSource, content_of

if TYPE_CHECKING:
    from clutchid.exports.c99 import Rates, Real
    from clutchid.exports.exporting import Target

__all__ = ["Export", "export"]


@checked
def export(
    calibration: CalibrationSource,
    out: str | PathLike[str],
    *,
    to: str | Sequence[Target] = ("c",),
    method: str = "joint",
    real: Real = "float",
    rates: Rates = "one",
    name: str = "clutch",
    resume: str | PathLike[str] | None = None,
    check: LogOrPath | Sequence[LogOrPath] = (),
    model: bool = False,
    supply_std: float | None = None,
    supply_sensor_std: float | None = None,
) -> Export:
    """Write the on-line observer of a calibration as C99 for a control unit, and compare it with the one in Python.

    Parameters
    ----------
    calibration : Fit, ParameterFile or path
        The calibration: the result of `clutchid.calibrate`, or a file with it.
    out
        Folder to write; it is created.
    to : 'c', 'fmu2', 'fmu3', 'matlab', 'a2l', 'dbc'
        What is written: several as a sequence, or as text, comma-separated.
    method
        Method of the observer.
    real : 'float' or 'double'
        Type of every number in C.
    rates : 'one' or 'two'
        Everything in the task of a sample, or corrections in a slower task.
    name
        Before every name in C, a C identifier.
    resume
        File with the state of an observer, from which the export goes on.
    check : Log or path, or several
        Recordings on which C and Python are compared; by default a short simulated drive.
    model
        Whether the actuator with its load is written as an FMU too.
    supply_std, supply_sensor_std : 1, optional
        As in `clutchid.observe`: the bands of the exported observer.

    Returns
    -------
    export : Export
        The files, and the differences of C and Python.

    Raises
    ------
    DataError, ParameterError, ExportError
        If an input is bad, or a file cannot be written.

    Examples
    --------
    C and Python differ by less than a thousandth of the peak load, in single precision:

    >>> import clutchid, tempfile
    >>> cal = clutchid.calibrate(clutchid.bundled_recording().slice(0, 4000), free="load,P_S")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export = clutchid.export(cal, folder)
    >>> "src/clutch.c" in export.files, export.parity.load < 1e-3
    (True, True)
    """
    from clutchid.exports.c99 import CStyle
    from clutchid.exports.exporting import targets_of, write_export
    from clutchid.exports.parity import begun
    from clutchid.observer.configuration import observer, start
    from clutchid.observer.prior import SUPPLY_STD
    from clutchid.observer.state_file import read_state, saved_spacing

    targets = targets_of(to) if isinstance(to, str) else to
    style, content = CStyle(name, real, rates), content_of(calibration)
    spacing = 1e-3 if resume is None else saved_spacing(resume)
    observing = observer(
        content.actuator, method, spacing, content.calibration,
        supply_std=SUPPLY_STD if supply_std is None else supply_std,
        supply_sensor_std=supply_sensor_std,
    )  # fmt: skip
    state = begun(observing, start(observing) if resume is None else read_state(observing, resume))
    logs = reading_of(check or ()).read(content.actuator)
    title = f"{'a fit' if isinstance(calibration, Fit | ParameterFile) else Path(calibration).name}, method {method}"
    return write_export(observing, state, Path(out), style, title, to=targets, check=logs, model=model)
