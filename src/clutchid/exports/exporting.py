"""The files of an export: an observer in C99, with what a control unit, a simulator and a measurement tool need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from clutchid.codegen.templates import template
from clutchid.errors import DataError, ParameterError
from clutchid.exports.a2l import a2l
from clutchid.exports.c99 import CStyle, compiler, observer_c99, source_files
from clutchid.exports.data import provenance
from clutchid.exports.fmu import FMUS, Fmu, missing_parts, model_fmu, observer_fmu
from clutchid.exports.frames import results_dbc
from clutchid.exports.matlab import matlab_files
from clutchid.exports.misra import CHECKER, FINDINGS
from clutchid.exports.outputs import REASONS
from clutchid.exports.parity import Parity, begins_us, parity, replay, replay_source, samples_of, trial_drive
from clutchid.exports.requirements import requirement_files, requirement_table
from clutchid.exports.target import example_files, vectors
from clutchid.files import make_folder, not_an_address, write_bytes
from clutchid.log import Log, sample_interval
from clutchid.observer.configuration import Observer
from clutchid.observer.state import ObserverState

Target = Literal["c", "fmu2", "fmu3", "matlab", "a2l", "dbc"]

#: Targets of an export, in the order in which they are written.
_TARGETS: tuple[Target, ...] = ("c", "fmu2", "fmu3", "matlab", "a2l", "dbc")

#: Pages of an export, and samples of its test.
PAGES, _VECTORS = ("parity", "readme"), 1500

#: A recording may be as much faster or slower than the observer, as a share of its rate.
_RATE = 0.05

#: Note on a calibration that was made without them.
NO_POSITION_ONLY = (
    "The calibration file has no errors of a load from position alone, so the band of the load does not include "
    "them; calibrate again to include them."
)

#: Cause of a difference in float.
BY_ROUNDING = (
    "In double precision the C code agrees with Python. The difference in float is rounding, which grows while the "
    "piston sticks, as an error of 10 nm in the position would. On 80 warm drives the rms difference of the "
    "pressure was at most 0.16 of its standard deviation, and one flag differed on 7 of them."
)
BY_EXPORT = "In double precision the C code does not agree with Python either: the export has an error."


@dataclass(frozen=True, slots=True)
class Export:
    """An export as it was written.

    Attributes
    ----------
    folder
        Where its files are.
    files
        Their paths in the folder.
    parities
        C against Python by recording; empty where it was not run.
    notes
        What was left out, one sentence each.
    style
        Prefix of names, type of numbers and rates.
    """

    folder: Path
    files: tuple[str, ...]
    parities: tuple[Parity, ...]
    notes: tuple[str, ...]
    style: CStyle

    @property
    def holds(self) -> bool:
        """Whether C and Python were compared and are alike on each recording."""
        return bool(self.parities) and not self._failed

    @property
    def parity(self) -> Parity | None:
        """C against Python on the first recording where they are not alike, else the first; None where not run."""
        return next(iter((*self._failed, *self.parities)), None)

    @property
    def message(self) -> str:
        """The export in a sentence: whether C and Python are alike, or on which recordings not; largest differences."""
        parities = self._failed or self.parities
        if not parities:
            return f"exported {len(self.files)} files; parity was not run."
        samples, load = sum(p.samples for p in parities), max(p.load for p in parities)
        pressure, theta = max(p.pressure for p in parities), max(p.theta for p in parities)
        return (
            f"the C {'agrees' if self.holds else 'does not agree'} with Python on "
            f"{', '.join(p.recording for p in parities)}, {samples} samples: load {100 * load:.2g} % of its peak, "
            f"pressure {pressure:.2g} Pa rms, theta {theta:.2g} prior standard deviations."
        )

    @property
    def _failed(self) -> tuple[Parity, ...]:
        return tuple(parity for parity in self.parities if not parity.holds(self.style))


def targets_of(text: str) -> tuple[Target, ...]:
    """Targets by their comma-separated names.

    Raises
    ------
    ParameterError
        If one is not known.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in names if name not in _TARGETS]
    if unknown or not names:
        raise ParameterError(
            f"--to {text}: {unknown[0] if unknown else 'nothing'!r} is not one of {', '.join(_TARGETS)}."
        )
    return tuple(target for target in _TARGETS if target in names)


def write_export(
    observer: Observer,
    state: ObserverState,
    folder: Path,
    style: CStyle,
    title: str,
    *,
    to: Sequence[Target] = ("c",),
    check: Sequence[Log] = (),
    model: bool = False,
) -> Export:
    """Write an observer for a control unit into a folder, which is made; files of the same names are replaced.

    Parameters
    ----------
    state
        What is known of the parameters that adapt, as `parity.begun` gives it.
    title
        What it was made from.
    check
        Recordings on which C and Python are compared, the first in ``test/`` too; by default a short simulated drive.
    model
        Whether the actuator with its load is written as an FMU too.

    Raises
    ------
    ParameterError
        If the method cannot be exported, or a `model` is wanted without 'fmu2' or 'fmu3'.
    DataError
        If a recording of `check` has another rate.
    ExportError
        If a file cannot be written, or the C does not compile.
    """
    not_an_address(folder)
    if model and not {"fmu2", "fmu3"} & set(to):
        raise ParameterError("--model is written as an FMU: add fmu2 or fmu3 to --to, for example --to c,fmu2.")
    modules = observer_c99(observer, state, style, title)
    logs = [_at_rate(log, observer) for log in check] or [trial_drive(observer)]
    # the C is given the temperature of the air between samples
    logs = [log.without(*(name for name in ("temperature_ambient",) if name in log)) for log in logs]
    cc, begins = compiler(), begins_us(logs[0])
    replays = [replay(observer, modules, style, log, cc) for log in logs] if cc else []
    parities = tuple(parity(observer, state, *pair) for pair in zip(logs, replays, strict=False))
    notes: tuple[str, ...] = () if cc else ("parity was not run: there is no C compiler (cc) on this machine.",)
    failed = [log for log, compared in zip(logs, parities, strict=False) if not compared.holds(style)]
    cause = ""
    if cc and failed and style.real == "float":
        double = replace(style, real="double")
        in_double = observer_c99(observer, state, double, title)
        alike = (parity(observer, state, log, replay(observer, in_double, double, log, cc)) for log in failed)
        cause = BY_ROUNDING if all(compared.holds(double) for compared in alike) else BY_EXPORT
        notes = (*notes, cause)
    if observer.calibration is None or observer.calibration.position_only is None:
        notes = (*notes, NO_POSITION_ONLY)
    files: dict[str, str | bytes] = {f"src/{file}": text for file, text in source_files(modules).items()}
    files |= example_files(style) | requirement_files(observer, style)
    files |= {"test/replay.c": replay_source(observer, style, begins)}
    if replays:
        samples, outputs = samples_of(logs[0])[:_VECTORS], replays[0].outputs[:_VECTORS]
        files["test/vectors.h"] = vectors(samples, outputs, style, begins)
    fmus: dict[str, Fmu] = {}
    for version, suffix in FMUS.items():
        if f"fmu{version}" in to:
            fmus[f"{style.name}{suffix}"] = observer_fmu(observer, state, style, modules, version)
            if model:
                name = f"{style.name}_model"
                fmus[f"{name}{suffix}"] = model_fmu(observer.actuator, name, version)
    files |= {f"fmu/{name}.fmu": fmu.content for name, fmu in fmus.items()}
    notes = (*notes, *(note for name, fmu in fmus.items() for note in missing_parts(f"fmu/{name}.fmu", fmu)))
    if "matlab" in to:
        files |= {f"matlab/{name}": text for name, text in matlab_files(style).items()}
    if "a2l" in to:
        files[f"a2l/{style.name}.a2l"] = a2l(observer, style, title)
    if "dbc" in to:
        files[f"dbc/{style.name}.dbc"] = results_dbc()
    head = provenance(observer).head
    headers = {name: text for name, text in files.items() if name.endswith(".h") and isinstance(text, str)}
    files |= {name: head + text for name, text in headers.items() if not text.startswith(head)}
    values = {
        "name": style.name, "style": style, "title": title, "to": to, "model": model, "observer": observer,
        "parities": parities, "cause": cause, "notes": notes,
        "findings": FINDINGS, "checker": CHECKER, "requirements": requirement_table(style.name),
        "reasons": REASONS,
    }  # fmt: skip
    files |= {f"{page.upper()}.md": template(f"{page}.md.j2", "clutchid.exports").render(values) for page in PAGES}
    for name, text in files.items():
        make_folder((folder / name).parent, "--out")
        write_bytes(text.encode() if isinstance(text, str) else text, folder / name)
    return Export(folder, tuple(sorted(files)), parities, notes, style)


def _at_rate(log: Log, observer: Observer) -> Log:
    interval = sample_interval(log.time, observer.spacing)
    if abs(interval / observer.spacing - 1.0) > _RATE:
        raise DataError(
            f"{log.name}: a sample every {interval * 1e3:.4g} ms, but the observer is for one every "
            f"{observer.spacing * 1e3:.4g} ms; give a recording at its rate, or leave --check out."
        )
    return log
