"""Results as files: parameter files, files for MATLAB, pages."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.arguments import checked
from clutchid.errors import ExportError

# imported on use: a command that only reads files starts faster
if TYPE_CHECKING:
    from clutchid.documents.next_step import Command
    from clutchid.estimation import Fit
    from clutchid.estimation.parameter_file import ParameterFile


def check_save(path: Path) -> None:
    """Check, before a long computation, that `save` can write a file with this name.

    Raises
    ------
    ExportError
        If the suffix is unknown, or MATLAB cannot use the name.
    """
    from clutchid.estimation.parameter_file import MATLAB_SUFFIXES
    from clutchid.exports.fit_file import check_name

    suffix = path.suffix.lower()
    if suffix in MATLAB_SUFFIXES:
        check_name(path)
    elif suffix not in ("", ".toml"):
        raise ExportError(
            f"{path}: the suffix '{path.suffix}' is not known; a fit is saved as .toml, for --start and simulate, or "
            "as .mat or .m, for MATLAB."
        )


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
    from clutchid.estimation.parameter_file import parameter_file as with_trust

    return with_trust(fit, verdict(fit).trust)


def save(fit: Fit, path: Path) -> None:
    """Write the result as a parameter file, or for MATLAB if the suffix is ``.mat`` or ``.m``.

    Raises
    ------
    ExportError
        If the suffix is unknown or the file cannot be written; an existing file is unchanged.
    """
    from clutchid.estimation.parameter_file import MATLAB_SUFFIXES, write_parameters
    from clutchid.exports.fit_file import write_matlab

    check_save(path)
    if path.suffix.lower() in MATLAB_SUFFIXES:
        write_matlab(fit, path)
    else:
        write_parameters(parameter_file(fit), path)


def report(fit: Fit, command: Command | str, path: Path) -> None:
    """Write the page of the result, with the `command` that repeats it.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    from clutchid.documents import document_of, write_page

    write_page(document_of(fit, command), path)
