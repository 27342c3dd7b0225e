"""The command line: one module per command. Large packages are imported on demand."""

from __future__ import annotations

import re
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from io import TextIOWrapper
from itertools import pairwise
from textwrap import wrap
from typing import Any

from cyclopts import App, Group, Parameter
from cyclopts.exceptions import (
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownCommandError,
    UnusedCliTokensError,
)

from clutchid.cli.app import app as page
from clutchid.cli.common import COMMON, DONE, FAILED, INTERRUPTED, complain
from clutchid.cli.compare import compare
from clutchid.cli.cut import cut
from clutchid.cli.drive import drive
from clutchid.cli.export import export
from clutchid.cli.fit import calibrate, estimate, fit
from clutchid.cli.fleet import fleet
from clutchid.cli.friction import friction
from clutchid.cli.look import look
from clutchid.cli.observe import observe
from clutchid.cli.paper import paper
from clutchid.cli.simulate import simulate
from clutchid.cli.track import track
from clutchid.documents.console import TERMINAL_WIDTH, lost, put
from clutchid.verbs.progress import when_compiling
from clutchid.version import installed_version

#: First lines of `clutchid --help`.
_HELP = """Estimate the load of a truck clutch on the piston of its pneumatic actuator, from a recording.

Begin with `clutchid look LOG.csv`, which shows what is in a recording and checks it. Then calibrate the truck once from
a recording with pressure, and estimate the load of later recordings from the position alone.
"""

#: Every command and its usage: the files come first, because options with several values take all that follows them.
_COMMANDS: tuple[tuple[Callable[..., int], str], ...] = (
    (look, "FILE [OPTIONS]"),
    (fit, "LOGS... [OPTIONS]"),
    (calibrate, "LOGS... [--save CAL.toml] [OPTIONS]"),
    (estimate, "LOGS... --start CAL.toml [OPTIONS]"),
    (page, "[FILES...] [OPTIONS]"),
    (compare, "SAVED... [OPTIONS]"),
    (simulate, "LOG --parameters FIT.toml --out SIM.parquet [OPTIONS]"),
    (observe, "LOG --start CAL.toml --out EST.parquet [OPTIONS]"),
    (export, "CALIBRATION --out FOLDER [OPTIONS]"),
    (track, "LOGS... --start CAL.toml --out WEAR.parquet [OPTIONS]"),
    (fleet, "SOURCE --start CAL.toml --out FOLDER [OPTIONS]"),
    (cut, "RECORDING --out BEST.parquet [OPTIONS]"),
    (friction, "FILES... [OPTIONS]"),
    (drive, "--out LOG.parquet [OPTIONS]"),
    (paper, "--out FOLDER [OPTIONS]"),
)

#: Arguments by the name of the command.
_USAGES = {command.__name__: usage for command, usage in _COMMANDS}

#: A number with decimals.
_FRACTION = re.compile(r"[+-]?\d*\.\d+")

#: Commands whose help leaves these options to `--help all`.
_LONG = ("fit", "calibrate", "estimate")
_RARE = (
    "--measure", "--every", "--parts", "--carry", "--take", "--model", "--prior", "--profile", "--bootstrap", "--zero",
    "--dbc", "--verbose", "--debug",
)  # fmt: skip

#: Types of options that are numbers.
_NUMBERS: dict[Any, str] = {int: "a whole number", float: "a number"}


def app() -> App:
    """The application with all commands."""
    application = App(
        name="clutchid",
        help=_HELP,
        version=installed_version,
        result_action="return_value",
        group_parameters=COMMON,
    )
    lists = Parameter(negative_iterable=())  # no --empty-NAME
    for place, (command, _) in enumerate(_COMMANDS):
        usage = _usage(command.__name__)
        application.command(command, usage=usage, sort_key=place, default_parameter=lists)
    return application


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # an unprintable unit or name must not prevent the output
    if sys.stderr.isatty():
        when_compiling(lambda sentence: put(sentence, to=sys.stderr))  # looked up late: streams can be replaced
    try:
        code = _run(tokens)
        sys.stdout.flush()
    except OSError as error:  # `OutputLost`, or what printed the help met
        code = FAILED
        lost(error)
    sys.exit(code)


def _run(tokens: list[str]) -> int:
    application = app()
    try:
        if fraction := _fraction(application, tokens):
            return complain(fraction, as_json="--json" in tokens, status="bad_input")
        if tokens[:1] and tokens[0] in _LONG and {"--help", "-h"} & {*tokens} and "all" not in tokens:
            put(*_short_help(application, tokens[0]))
            return DONE
        if tokens[-2:] in (["--help", "all"], ["-h", "all"]):
            tokens = tokens[:-1]
        code = application(tokens, exit_on_error=False, print_error=False)
    except KeyboardInterrupt:  # before the command took over
        complain("stopped.", as_json="--json" in tokens, status="failed")
        return INTERRUPTED
    except CycloptsError as error:
        if "--debug" in tokens:
            traceback.print_exc()
        sentence = f"{_sentence(error)} {_usage(next(iter(error.command_chain or ()), ''))}"
        return complain(sentence, as_json="--json" in tokens, status="bad_input")
    return code if isinstance(code, int) else DONE


def _usage(name: str) -> str:
    return f"Usage: clutchid {name} {_USAGES[name]}" if name in _USAGES else "Try 'clutchid --help'."


def _short_help(application: App, name: str) -> Iterator[str]:
    """Lines of a help that fits a screen: usage, purpose, and the first sentence on each everyday option, in groups."""
    command, group = application[name], ""
    yield from (_usage(name), *wrap(str(command.help).partition("\n")[0].replace("`", ""), TERMINAL_WIDTH), "")
    for a in command.assemble_argument_collection(parse_docstring=True):
        if a.parse and not a.children and a.name not in _RARE:
            groups = a.parameter.group
            title = groups[0].name if isinstance(groups, tuple) and isinstance(groups[0], Group) else ""
            if title != group:
                yield f"{title}:"
            group, sentence = title, f"{a.parameter.help}".partition(". ")[0].replace("`", "").rstrip(".")
            yield f"  {a.name:<10} {sentence}."
    yield from wrap(f"More options, listed by `clutchid {name} --help all`: {', '.join(_RARE)}", TERMINAL_WIDTH)


def _fraction(application: App, tokens: Sequence[str]) -> str:
    """A sentence where a whole number is given as a fraction, which the parser would round; else nothing."""
    words = [word for token in tokens for word in token.split("=", 1)]
    fractions = {name: value for name, value in pairwise(words) if _FRACTION.fullmatch(value) and float(value) % 1.0}
    if not fractions or tokens[0] not in _USAGES:
        return ""
    for argument in application[tokens[0]].assemble_argument_collection():
        for name in fractions.keys() & {*argument.names} if argument.hint in (int, int | None) else ():
            return f"{name} {fractions[name]}: {_NUMBERS[int]} is expected. {_usage(tokens[0])}"
    return ""


def _sentence(error: CycloptsError) -> str:
    """The words of a command that cannot be understood."""
    name = error.argument.name if error.argument else ""
    match error:
        case MissingArgumentError():
            return f"{name} has no value." if error.keyword else f"{name} is missing."
        case RepeatArgumentError(token=token):
            return f"{token.keyword} is given more than once."
        case UnknownCommandError(unused_tokens=tokens):
            return f"{next(iter(tokens or ()), '')} is not a command; the commands are {', '.join(_USAGES)}."
        case UnusedCliTokensError(unused_tokens=tokens):
            return f"{' '.join(tokens or ())}: not expected here."
        case CoercionError(target_type=wanted, token=token) if token and wanted in _NUMBERS:
            return f"{name} {token.value}: {_NUMBERS[wanted]} is expected."
    return " ".join(str(error).split())


if __name__ == "__main__":
    main()
