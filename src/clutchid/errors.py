"""Exceptions of clutchid, by what the caller must correct.

Each one is also a built-in exception, so that code without knowledge of clutchid can catch it.
"""

import re
import sys
from collections.abc import Iterable
from importlib.util import find_spec


class ClutchidError(Exception):
    """Base class of all errors that clutchid raises; the text is written for the user.

    Examples
    --------
    A negative conductance, as any caller of clutchid may catch it:

    >>> import clutchid
    >>> try:
    ...     clutchid.Parameters(C_vs=-1.9e-8)
    ... except ClutchidError as error:
    ...     print(error)
    C_vs = -1.9e-08 m³/(Pa·s): a conductance must be at least 0 and at most 1e-05. Appendix A has 1.9e-08.
    """

    @classmethod
    def raise_for(cls, problems: Iterable[str]) -> None:
        """Raise one error that lists all `problems`, if there are any."""
        if text := "\n".join(problems):
            raise cls(text)


class ParameterError(ClutchidError, ValueError):
    """A parameter, bound or option is not admissible.

    Examples
    --------
    A clutch does not weigh a milligram:

    >>> import clutchid
    >>> try:
    ...     clutchid.Parameters(M=1e-6)
    ... except ValueError as error:  # a ParameterError is a ValueError
    ...     print(error)
    M = 1e-06 kg: it must be at least 1e-05 and at most 100000. Appendix A has 10.
    """


class DataError(ClutchidError, ValueError):
    """A recording cannot be used; the text lists every problem found in it.

    Examples
    --------
    Two samples cannot have one time:

    >>> import clutchid
    >>> try:
    ...     clutchid.Log([0.0, 1e-3, 1e-3], {"position": [0.0, 0.0, 0.0]})
    ... except ValueError as error:  # a DataError is a ValueError
    ...     print(error)
    log: time must be one column of finite, strictly increasing values.
    """

    @classmethod
    def of(cls, source: str, problems: list[str]) -> "DataError":
        """One error for all `problems` of the file or recording `source`."""
        if len(problems) == 1:
            return cls(f"{source}: {problems[0]}")
        return cls(f"{source}: {len(problems)} problems.\n" + "\n".join(f"  - {problem}" for problem in problems))


class SolveError(ClutchidError, ArithmeticError):
    """A simulation or a fit produced values that are not finite.

    Examples
    --------
    A load that pulls with a giganewton a metre leaves no finite motion:

    >>> import clutchid
    >>> import numpy as np
    >>> t = np.arange(0.0, 0.1, 1e-3)
    >>> pulse = clutchid.Log(t, {"duty_supply": np.ones(100), "duty_exhaust": np.zeros(100)})
    >>> try:
    ...     clutchid.simulate(clutchid.Actuator(load=clutchid.Load((-1e9, 0.0, 0.0))), pulse)
    ... except ArithmeticError as error:  # a SolveError is an ArithmeticError
    ...     print(type(error).__name__)
    SolveError
    """


class ExportError(ClutchidError, OSError):
    """An output cannot be written; no partial file is left.

    Examples
    --------
    >>> import clutchid
    >>> try:
    ...     clutchid.write(clutchid.Log([0.0, 1e-3], {"position": [0.0, 0.0]}), "run.xyz")
    ... except OSError as error:  # an ExportError is an OSError
    ...     print(error)
    run.xyz: the suffix '.xyz' is not known; a log is written as .csv, .parquet, .mf4 or .mat.
    """


class MissingExtra(ClutchidError, ImportError):
    """An optional dependency is not installed.

    Examples
    --------
    Reading an MDF file without asammdf raises it; code that knows no clutchid can catch it:

    >>> issubclass(MissingExtra, ImportError)
    True
    """


def requirements(extra: str) -> tuple[str, ...]:
    """The requirements of an extra of clutchid, as its metadata have them.

    Examples
    --------
    >>> [re.match("[a-z0-9-]+", requirement)[0] for requirement in requirements("mat")]
    ['h5py', 'mat-io']
    """
    from importlib.metadata import requires  # slow to import, and asked for only where a library is absent

    marked = [requirement.partition(";") for requirement in requires("clutchid") or ()]
    return tuple(text.strip() for text, _, marker in marked if re.search(rf"extra\s*==\s*['\"]{extra}['\"]", marker))


def install_command(extra: str) -> str:
    """The command that installs the libraries of an extra, without clutchid itself, which may be on no index.

    It names the interpreter, as the `pip` of a terminal may belong to another environment.
    """
    python = f'"{sys.executable}"' if " " in sys.executable else sys.executable
    pip = f"{python} -m pip install" if find_spec("pip") else f"uv pip install --python {python}"
    return " ".join([pip, *(f'"{requirement}"' for requirement in requirements(extra))])


def missing(what: str, library: str, extra: str) -> MissingExtra:
    """The error that `what` needs a library of an extra, which is not installed."""
    return MissingExtra(f"{what} needs {library}, which is not installed; install it with: {install_command(extra)}")
