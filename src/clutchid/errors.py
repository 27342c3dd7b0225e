"""What can go wrong, named by what the caller must mend.

Each error is also a built-in, so code that knows nothing of clutchid can catch it.
"""


class ClutchidError(Exception):
    """Any error that clutchid raises on purpose; its text is meant for the user."""


class ParameterError(ClutchidError, ValueError):
    """A parameter, bound or option is outside what is allowed."""


class DataError(ClutchidError, ValueError):
    """A recording cannot be used; the text lists every problem found in it."""

    @classmethod
    def of(cls, source: str, problems: list[str]) -> "DataError":
        """One error for all `problems` of the file or recording `source`."""
        if len(problems) == 1:
            return cls(f"{source}: {problems[0]}")
        return cls(f"{source}: {len(problems)} problems.\n" + "\n".join(f"  - {problem}" for problem in problems))


class SolveError(ClutchidError, ArithmeticError):
    """A simulation or a fit left the finite numbers."""


class ExportError(ClutchidError, OSError):
    """An output cannot be written; nothing was left half-written."""


class MissingExtra(ClutchidError, ImportError):
    """An optional dependency is not installed."""
