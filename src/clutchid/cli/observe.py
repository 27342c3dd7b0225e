"""``clutchid observe``: follow load and pressure of a recording from position and duty cycles, sample by sample."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from clutchid.cli.common import DONE, guarded
from clutchid.cli.observe_live import observe_live
from clutchid.cli.observe_output import ObserveOptions, answer
from clutchid.errors import ParameterError
from clutchid.verbs.live import STANDARD_INPUT, is_live


@guarded
def observe(
    log: Annotated[Path, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    options: ObserveOptions,
) -> int:
    """Estimate load and pressure sample by sample, as a control unit would, from a file or live.

    The observer starts from the load of a calibration, and only looks back: it is what a control unit could know at
    each sample.

    Parameters
    ----------
    log
        Recording in any format that `clutchid look` reads; `-` follows CSV or JSON lines on standard input while they
        arrive, until they end or Ctrl-C; `can:CHANNEL` follows a bus.
    """
    from clutchid.verbs.observing import observed
    from clutchid.verbs.start import calibration_file

    if str(log).startswith("-") and str(log) != STANDARD_INPUT:
        raise ParameterError(f"Unknown option: {log}. Try 'clutchid observe --help'.")
    options.check(log)
    content = calibration_file(options.start)
    if options.follow or is_live(log):
        return observe_live(log, content, options)
    reading = options.files.reading([log], force=options.force, zero=options.zero)
    run = observed(reading, content, options.method, options.resume)
    options.write(run, content)
    answer(run, content, options)
    return DONE
