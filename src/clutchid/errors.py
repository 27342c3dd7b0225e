"""Exceptions of clutchid, by what the caller must correct.

Each one is also a built-in exception, so that code without knowledge of clutchid can catch it.
"""


class ClutchidError(Exception):
    """Base class of all errors that clutchid raises; the text is written for the user."""


class ParameterError(ClutchidError, ValueError):
    """A parameter, bound or option is not admissible."""


class DataError(ClutchidError, ValueError):
    """A recording cannot be used; the text lists every problem found in it."""

    @classmethod
    def of(cls, source: str, problems: list[str]) -> "DataError":
        """One error for all `problems` of the file or recording `source`."""
        if len(problems) == 1:
            return cls(f"{source}: {problems[0]}")
        return cls(f"{source}: {len(problems)} problems.\n" + "\n".join(f"  - {problem}" for problem in problems))


class SolveError(ClutchidError, ArithmeticError):
    """A simulation or a fit produced values that are not finite."""


class ExportError(ClutchidError, OSError):
    """An output cannot be written; no partial file is left."""


class MissingExtra(ClutchidError, ImportError):
    """An optional dependency is not installed."""
