"""The command line: one file a verb. Heavy packages are imported where a verb needs them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import version

from cyclopts import App
from cyclopts.exceptions import CycloptsError

from clutchid.cli.common import complain
from clutchid.cli.drive import drive
from clutchid.cli.fit import fit
from clutchid.cli.look import look
from clutchid.cli.paper import paper
from clutchid.cli.prove import prove
from clutchid.cli.simulate import simulate


def app() -> App:
    """The application with all verbs."""
    application = App(
        name="clutchid",
        help="From a recording of an electropneumatic clutch actuator to the load that the clutch puts on its piston.",
        version=version("clutchid"),
        result_action="return_value",
    )
    for verb in (fit, simulate, paper, look, drive, prove):
        application.command(verb)
    return application


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 failed, 2 bad input."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = app()(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        message = " ".join(str(error).split())
        code = complain(f"{message} Try 'clutchid --help'.", as_json="--json" in tokens, status="bad_input")
    sys.exit(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    main()
