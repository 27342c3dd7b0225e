"""Any error as a sentence for the user and a status, for the command line and the page."""

from __future__ import annotations

from clutchid.errors import ClutchidError, DataError, ExportError, ParameterError


def failure(error: BaseException, *, debug: bool) -> tuple[str, str]:
    """The sentence for an error, and the status "bad_input" or "failed".

    Parameters
    ----------
    debug
        Whether the traceback was shown, so that the sentence need not say how to see it.

    Examples
    --------
    >>> failure(DataError("log.csv: is empty."), debug=False)
    ('log.csv: is empty.', 'bad_input')
    """
    if isinstance(error, ClutchidError):
        bad = isinstance(error, (DataError, ParameterError, ExportError))
        return str(error), "bad_input" if bad else "failed"
    if isinstance(error, (MemoryError, KeyboardInterrupt)):
        return "stopped." if isinstance(error, KeyboardInterrupt) else "stopped: out of memory.", "failed"
    what = f"an error that clutchid did not expect, {type(error).__name__}: {error}."
    return f"{what} {'Report it with the traceback.' if debug else 'Run again with --debug and report it.'}", "failed"
