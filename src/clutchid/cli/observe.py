"""``clutchid observe``: follow load and pressure of a recording from position and duty cycles, sample by sample."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from clutchid.cli.common import DONE, guarded
from clutchid.cli.observe_live import observe_live
from clutchid.cli.observe_output import STANDARD_INPUT, ObserveOptions, answer, calibration_file, is_live
from clutchid.errors import ParameterError
from clutchid.measurements.checks import AMBIENT
from clutchid.parameters import known_ambient
from clutchid.workflow import FileOptions, fast_enough, inspected, observed, read_recordings
from clutchid.workflow.options import pressure


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
    if str(log).startswith("-") and str(log) != STANDARD_INPUT:
        raise ParameterError(f"Unknown option: {log}. Try 'clutchid observe --help'.")
    options.check(log)
    content = calibration_file(options.start)
    air, added = pressure(options.ambient, None), known_ambient(content.actuator.parameters.P_0)
    if options.follow or is_live(log):
        return observe_live(log, content, options, air or added or AMBIENT)
    files = FileOptions(air, options.map_, tuple(options.dbc or ()), added)
    read = read_recordings([log], files, content.actuator.equipment)
    (checked,) = inspected(read, content.actuator, force=options.force, rest=content.rest, zero=options.zero)
    checked = fast_enough(checked, content, force=options.force)
    run = observed(checked, content, options.method, options.resume, options.zero)
    options.write(run, content)
    answer(run, content, options)
    return DONE
