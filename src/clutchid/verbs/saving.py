"""Results as files: parameter files, and files for MATLAB."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.arguments import checked
from clutchid.errors import ExportError, ParameterError
from clutchid.files import check_writable

# imported on use: a command that only reads files starts faster
if TYPE_CHECKING:
    from clutchid.estimation import Fit
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.log import Log


def check_save(path: Path) -> None:
    """Check, before a long computation, that `save_fit` can write a file with this name.

    Raises
    ------
    ExportError
        If the suffix is unknown.
    """
    from clutchid.estimation.parameter_file import MATLAB_SUFFIX

    if path.suffix.lower() not in ("", ".toml", MATLAB_SUFFIX):
        raise ExportError(
            f"{path}: the suffix '{path.suffix}' is not known; a fit is saved as .toml, for --start and simulate, or "
            "as .mat, for MATLAB, Octave and Simulink."
        )


def loads_path(out: Path) -> Path:
    """The file of the loads beside `out`, the rows or samples that they belong to."""
    return out.with_name(f"{out.stem}.load{out.suffix}")


@checked
def parameter_file(fit: Fit) -> ParameterFile:
    """Contents of a parameter file for a fit, with the trust of its verdict.

    Parameters
    ----------
    fit : Fit
        Of any method and status.

    Returns
    -------
    content : ParameterFile
        `clutchid.write_parameters` writes it; `clutchid.estimate` takes it as a calibration.

    Examples
    --------
    >>> import clutchid
    >>> fit = clutchid.fit(clutchid.bundled_recording().slice(0, 4000))
    >>> content = clutchid.parameter_file(fit)
    >>> content.actuator == fit.actuator, content.fit["free"]
    (True, ['theta_1', 'theta_2', 'theta_3'])
    """
    from clutchid.estimation.assess.verdict import verdict
    from clutchid.estimation.parameter_file import contents_of_fit as with_trust

    return with_trust(fit, verdict(fit).trust)


def save_fit(fit: Fit, path: Path) -> None:
    """Write the result as a parameter file, or for MATLAB if the suffix is ``.mat``.

    Raises
    ------
    ExportError
        If the suffix is unknown or the file cannot be written; an existing file is unchanged.
    """
    from clutchid.estimation.parameter_file import MATLAB_SUFFIX, write_parameters
    from clutchid.exports.fit_file import write_matlab

    check_save(path)
    if path.suffix.lower() == MATLAB_SUFFIX:
        write_matlab(fit, path)
    else:
        write_parameters(parameter_file(fit), path)


def write_log(log: Log, path: Path) -> None:
    """`clutchid.write`: a recording in the format of its suffix, with libraries that are imported on use."""
    from clutchid.measurements import write

    write(log, path)


def check_outputs(
    outputs: Mapping[str, Path | Sequence[Path] | None], inputs: Sequence[tuple[str, Path | None]]
) -> None:
    """Check, before any work, that `outputs` can be written, and overwrite neither an input nor each other.

    `outputs` are a path, or several, by option; `inputs` are (description, path).
    """
    taken = [(what, path) for what, path in inputs if path is not None]
    for option, path in _paths_of(outputs):
        for what, other in taken:
            if _same(path, other):
                raise ParameterError(f"{option} {path}: is {what}; name another file.")
        check_writable(path)
        taken.append((f"the file of {option} too", path))


def _paths_of(outputs: Mapping[str, Path | Sequence[Path] | None]) -> Iterator[tuple[str, Path]]:
    """Every path with its option."""
    for option, paths in outputs.items():
        for path in (paths,) if isinstance(paths, Path) else paths or ():
            yield option, path


def _same(path: Path, other: Path) -> bool:
    """Whether two paths are the same file, also by links or another spelling."""
    try:
        return path.resolve() == other.resolve() or path.samefile(other)
    except (OSError, RuntimeError):  # one of them does not exist, or is a loop of links
        return False
