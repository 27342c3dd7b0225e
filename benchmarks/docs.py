"""Run the commands of the documentation: ``python benchmarks/docs.py [PAGE...] [--write]``.

A block that is fenced as ``console`` has commands behind ``$``, each followed by what it prints; an exit code other
than 0 is printed as ``[exit code 2]``, or by ``$ echo $?``. The blocks of a page run in order, in one temporary
folder. Words must be equal and numbers to two digits, or to the last decimal that is printed; ``...`` stands for any
lines, and in a line for a word. Blocks below ``<!-- long -->`` run only here; the others run in ``tests/docs`` too. A
fenced block below ``<!-- file NAME -->`` is written to the folder.

The README shows commands of `SOURCE`, which runs them.

With ``--write`` the pages get what is printed now: of an output with a line ``...`` as many lines before and behind it
as there were.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from unittest import mock

from clutchid.cli import main as clutchid

DOCS = Path(__file__).resolve().parents[1] / "docs"
README, SOURCE = DOCS.parent / "README.md", DOCS / "first_hour.md"

#: Stands for any number of lines, or for a word in a line.
SKIP = "..."

#: Prints the exit code of the command before.
EXIT_CODE = "echo $?"

#: Commands that are run once for the same files, and their exit code, output and files by command and files read.
ONCE = re.compile(r"clutchid (drive|calibrate) (?!--fleet)")
_RUNS: dict[tuple[str, tuple[tuple[str, bytes], ...]], tuple[tuple[int, str], dict[str, bytes]]] = {}

_FENCE = re.compile(
    r"^(?:<!-- (?P<mark>long|file (?P<name>\S+)) -->\n)?```(?P<kind>\w*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL
)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?![\d.]*\w)")
_VOLATILE = (
    (re.compile(r"\b[0-9a-f]{8,64}\b"), "HASH"),
    (re.compile(r"\b\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d)?)?"), "DATE"),
)


class Step(NamedTuple):
    """A command as it is typed, what it should print, and where its output lies in the page: offsets of characters."""

    command: str
    expected: str
    start: int
    stop: int


class Block(NamedTuple):
    """A block of a page: the `steps` of a console, or the `text` of a file `name`; `line` of the page."""

    line: int
    long: bool
    steps: tuple[Step, ...]
    name: str = ""
    text: str = ""


class Difference(NamedTuple):
    """A command of a page that prints something else."""

    line: int
    step: Step
    printed: str

    def __str__(self) -> str:
        return (
            f"line {self.line}: $ {self.step.command}\n--- in the page\n{self.step.expected}--- printed\n{self.printed}"
        )


def pages() -> list[Path]:
    """The pages that have commands to run."""
    return [page for page in sorted(DOCS.rglob("*.md")) if blocks(page.read_text(encoding="utf-8"))]


def blocks(page: str) -> list[Block]:
    """Consoles and files of a page, in order."""
    blocks_of_page = []
    for fence in _FENCE.finditer(page):
        line = page.count("\n", 0, fence.start("body")) + 1
        if fence["name"]:
            blocks_of_page.append(Block(line, False, (), fence["name"], fence["body"]))
        elif fence["kind"] == "console":
            blocks_of_page.append(
                Block(line, fence["mark"] == "long", tuple(_steps(fence["body"], fence.start("body"))))
            )
    return blocks_of_page


def _steps(body: str, offset: int) -> Iterator[Step]:
    """The commands of a console whose text begins at `offset`; a backslash continues a command in the next line."""
    commands = list(re.finditer(r"^\$ ((?:.*\\\n)*.*)\n", body, re.MULTILINE))
    ends = [*(command.start() for command in commands[1:]), len(body)]
    for command, end in zip(commands, ends, strict=True):
        yield Step(command[1], body[command.end() : end], offset + command.end(), offset + end)


def differences(page: str, *, long: bool) -> list[Difference]:
    """Run the blocks of a page, `long` ones only if wanted; the commands that print something else.

    `drive` and `calibrate` write the same from the same files, so that pages that begin alike do so once a process.
    """
    differences_of_page = []
    code = 0
    with tempfile.TemporaryDirectory() as temporary, contextlib.chdir(temporary):
        folder = Path(temporary).resolve()
        for block in blocks(page):
            if block.name:
                (folder / block.name).write_text(block.text, encoding="utf-8")
            for number, step in enumerate(block.steps if long or not block.long else (), 1):
                code, output = once(step.command) if ONCE.match(step.command) else run(step.command, code)
                printed = output.replace(f"{folder}{os.sep}", "")
                if code and [after.command for after in block.steps[number : number + 1]] != [EXIT_CODE]:
                    printed += f"[exit code {code}]\n"
                if not same(step.expected, printed):
                    differences_of_page.append(Difference(block.line, step, printed))
    return differences_of_page


def excerpts(page: str, source: str) -> list[Difference]:
    """The commands of a page of which another page shows another output, or none."""
    printed = {step.command: step.expected for block in blocks(source) for step in block.steps}
    steps = [(block.line, step) for block in blocks(page) for step in block.steps]
    others = ((line, step, printed.get(step.command, "")) for line, step in steps)
    return [Difference(*other) for other in others if not same(other[1].expected, other[2])]


def once(command: str) -> tuple[int, str]:
    """What a command printed, and what it wrote, when it was run with the same files before; else it is run."""
    inputs = {path.name: path.read_bytes() for path in map(Path, command.split()) if path.is_file()}
    key = command, tuple(inputs.items())
    if key not in _RUNS:
        code, output = run(command)
        answer = code, output.replace(f"{Path().resolve()}{os.sep}", "")  # another page has another folder
        outputs = {path.name: path.read_bytes() for path in map(Path, command.split()) if path.is_file()}
        _RUNS[key] = answer, {name: content for name, content in outputs.items() if inputs.get(name) != content}
    answer, written = _RUNS[key]
    for name, content in written.items():
        Path(name).write_bytes(content)
    return answer


def run(command: str, last: int = 0) -> tuple[int, str]:
    """Exit code of a command and what it prints on both streams; ``echo $?`` prints the `last` exit code."""
    words = shlex.split(command.replace("\\\n", " "), comments=True)
    if words == EXIT_CODE.split():
        return 0, f"{last}\n"
    if words[0] == "python":
        command = f"{shlex.quote(sys.executable)}{command[6:]}"
    if words[0] != "clutchid":
        scripts = str(Path(sys.executable).parent)  # where `clutchid` lies, for `cat LOG | clutchid ...`
        process = subprocess.run(
            command,
            shell=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            env={**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ.get('PATH', '')}"},
        )
        return process.returncode, process.stdout
    output = io.StringIO()
    code: object = 0
    with (
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(output),
        mock.patch.object(sys, "argv", words),
        mock.patch.dict(os.environ, COLUMNS="80"),
    ):
        try:
            clutchid(words[1:])
        except SystemExit as end:
            code = end.code
    return int(str(code or 0)), output.getvalue()


def same(expected: str, printed: str) -> bool:
    """Whether a text is the expected one, whose line ``...`` stands for any lines, with its numbers to two digits.

    >>> same("rms 0.0381 mm\\n...\\ntrust: good", "rms 0.0383 mm\\nload 4528 N\\ntrust: good")
    True
    >>> same("peak load 4528 N", "peak load 4700 N"), same("peak 5 N", "peak 5 kN")
    (False, False)
    """
    words = [_words(piece) for piece in re.split(rf"(?m)^{re.escape(SKIP)}$", expected)]
    actual = _words(printed)
    if len(words) == 1:
        return _equal(words[0], actual)
    first, *middle, last = words
    end = len(actual) - len(last)
    at = len(first)
    if at > end or not (_equal(first, actual[:at]) and _equal(last, actual[end:])):
        return False
    for piece in middle:
        places = range(at, end - len(piece) + 1)
        place = next((i for i in places if _equal(piece, actual[i : i + len(piece)])), None)
        if place is None:
            return False
        at = place + len(piece)
    return True


def _words(text: str) -> list[str]:
    for pattern, word in _VOLATILE:
        text = pattern.sub(word, text)
    return text.split()


def _equal(expected: Sequence[str], actual: Sequence[str]) -> bool:
    return len(expected) == len(actual) and all(map(_alike, expected, actual))


def _alike(line: str, other: str) -> bool:
    """Whether two words are equal, and their numbers to two significant digits."""
    if line in (other, SKIP):
        return True
    if _NUMBER.sub("#", line) != _NUMBER.sub("#", other):
        return False
    pairs = zip(_NUMBER.findall(line), _NUMBER.findall(other), strict=True)
    return all(_close(a.replace(",", ""), b.replace(",", "")) for a, b in pairs)


def _close(number: str, other: str) -> bool:
    """Whether two numbers differ by at most one unit of the second digit, or of the last decimal that is printed."""
    a, b = float(number), float(other)
    largest = max(abs(a), abs(b))
    second = 10.0 ** (math.floor(math.log10(largest)) - 1) if largest else 0.0
    decimals = re.search(r"\.(\d+)$", number)
    last = 10.0 ** -len(decimals[1]) if decimals else 0.0
    return abs(a - b) <= 1.001 * max(second, last)


def rewritten(page: str, differences: Sequence[Difference]) -> str:
    """A page with what its commands print now."""
    for difference in sorted(differences, key=lambda item: -item.step.start):
        step = difference.step
        page = page[: step.start] + _shortened(difference.printed, step.expected) + page[step.stop :]
    return page


def _shortened(printed: str, expected: str) -> str:
    """As much of a text as the expected one had before and behind its line ``...``."""
    lines, old = printed.splitlines(), expected.splitlines()
    if SKIP in old:
        head, tail = old.index(SKIP), len(old) - 1 - old.index(SKIP)
        if head + tail < len(lines):
            lines = [*lines[:head], SKIP, *lines[len(lines) - tail :]]
    return "".join(f"{line}\n" for line in lines)


def main() -> None:
    """Run the commands of the pages, and say which print something else."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="*", type=Path, help="pages to run; all by default")
    parser.add_argument("--write", action="store_true", help="put what is printed now into the pages")
    options = parser.parse_args()
    failed = False
    for page in [path.resolve() for path in options.pages] or [*pages(), README]:
        text = page.read_text(encoding="utf-8")
        begin = time.perf_counter()
        excerpt = page == README
        changes = excerpts(text, SOURCE.read_text(encoding="utf-8")) if excerpt else differences(text, long=True)
        print(f"{page.name}: {len(changes)} different, {time.perf_counter() - begin:.1f} s", flush=True)
        if options.write:
            page.write_text(rewritten(text, changes), encoding="utf-8")
        else:
            print(*changes, sep="\n", end="\n" if changes else "")
            failed |= bool(changes)
    sys.exit(failed)


if __name__ == "__main__":
    main()
