"""Whether tests notice faults: ``python benchmarks/mutants.py [WORD ...] [--jobs N] [--timeout S] [--out FILE.json]``.

Each row of ``mutants.toml`` is one fault: a text that stands once in a file of the package, what replaces it, and the
tests that have to fail then. A mutant runs in a copy of the work tree; where it changes what is compiled, with a cache
of its own, else with one for all. With words only the mutants run whose file, fault or tests have one of them;
``--check`` only looks whether every text stands once, and ``--sound`` whether the tests pass without a mutant.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".toml")

#: What is compiled to machine code: kernels, equations, and what generates either.
_COMPILED = re.compile(r"^@(?:kernel|inlined)", re.MULTILINE)
_EQUATIONS = ("codegen/", "model/", "truck/equations/")


@dataclass(frozen=True, slots=True)
class Mutant:
    """A fault: the file below src/clutchid, the text and its replacement, the tests that notice it."""

    file: str
    text: str
    replacement: str
    tests: tuple[str, ...]
    fault: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a mutant: killed, survived, timed out or without tests, after how many seconds, and by which test."""

    file: str
    fault: str
    result: str
    seconds: float
    by: str = ""


def mutants(words: Sequence[str] = ()) -> list[Mutant]:
    """The rows of the table that have one of these words, all without words."""
    rows = [
        Mutant(row["file"], row["text"], row["replacement"], tuple(row["tests"]), row["fault"])
        for row in tomllib.loads(TABLE.read_text("utf-8"))["mutant"]
    ]
    return [row for row in rows if not words or any(word in " ".join(map(str, asdict(row).values())) for word in words)]


def place_of(mutant: Mutant, package: Path) -> Path:
    """The file with the text of a mutant: its own, or after a move the only one that has it.

    Raises
    ------
    LookupError
        If the text does not stand there once.
    """
    own = package / mutant.file
    moved = not own.is_file() or mutant.text not in own.read_text("utf-8")
    files = [path for path in package.rglob("*") if path.suffix in (".py", ".j2")] if moved else [own]
    counts = {path: count for path in files if (count := path.read_text("utf-8").count(mutant.text))}
    if list(counts.values()) != [1]:
        shown = ", ".join(f"{path.relative_to(package)}: {count}" for path, count in counts.items()) or "nowhere"
        raise LookupError(f"{mutant.file}: {mutant.text!r} must stand once ({shown}).")
    return next(iter(counts))


@contextmanager
def work_tree(folder: Path) -> Iterator[Path]:
    """A copy of the tracked files in `folder`, with what lies beside the repository."""
    tree = folder / "tree"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout
    for name in filter(None, listed.decode().split("\0")):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, tree / name)
    if (ROOT.parent / "shared").is_dir():
        (folder / "shared").symlink_to((ROOT.parent / "shared").resolve())
    yield tree


def tested(tree: Path, tests: Sequence[str], cache: Path, timeout: float) -> tuple[str, str]:
    """Result of the tests in a tree, and the first one that failed."""
    paths = [name for name in tests if (tree / name).exists()]
    if not paths:
        return "no tests", ""
    cache.mkdir(mode=0o700, exist_ok=True)
    environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "CLUTCHID_CACHE": str(cache), "PYTHONHASHSEED": "0"}
    command = [sys.executable, "-B", "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *paths]
    try:
        run = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=timeout, check=False
        )
    except subprocess.TimeoutExpired:
        return "timed out", ""
    first = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - |$)", run.stdout, re.MULTILINE)
    return {0: "survived", 5: "no tests"}.get(run.returncode, "killed"), first[1] if first else run.stdout[-200:]


def judged(mutant: Mutant, tree: Path, shared_cache: Path, timeout: float) -> Outcome:
    """Outcome of one mutant in a tree, which is afterwards as before."""
    path = place_of(mutant, tree / "src" / "clutchid")
    before, begin = path.read_text("utf-8"), time.perf_counter()
    compiled = mutant.file.startswith(_EQUATIONS) or _COMPILED.search(before)
    path.write_text(before.replace(mutant.text, mutant.replacement), "utf-8")
    try:
        with tempfile.TemporaryDirectory() as own:
            cache = Path(own) / "cache" if compiled else shared_cache
            result, by = tested(tree, mutant.tests, cache, timeout)
    finally:
        path.write_text(before, "utf-8")
    survived = result != "killed"
    return Outcome(mutant.file, mutant.fault, result, round(time.perf_counter() - begin, 1), "" if survived else by)


def unsound(tree: Path, rows: Sequence[Mutant], cache: Path, timeout: float) -> Iterator[str]:
    """The tests of some mutants that do not pass without one."""
    for tests in dict.fromkeys(row.tests for row in rows):
        result, by = tested(tree, tests, cache, timeout)
        if result != "survived":
            yield f"{' '.join(tests)}: {result} {by}"


def main() -> None:
    """Run the mutants, print an outcome a line, and write all of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("words", nargs="*", help="words of the mutants that run; all without any")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at once")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds a mutant")
    parser.add_argument("--out", type=Path, help="file of the outcomes, in JSON")
    parser.add_argument("--check", action="store_true", help="only look whether every text stands once")
    parser.add_argument("--sound", action="store_true", help="only look whether the tests pass without a mutant")
    options = parser.parse_args()
    rows = mutants(options.words)
    problems = []
    for row in rows:
        try:
            place_of(row, ROOT / "src" / "clutchid")
        except LookupError as problem:
            problems.append(str(problem))
        problems += [f"{row.file}: there is no {name}" for name in row.tests if not (ROOT / name).exists()]
    if problems or options.check:
        sys.exit("\n".join(problems) or f"{len(rows)} mutants, each of a text that stands once.")
    with tempfile.TemporaryDirectory() as folder:
        trees: Queue[Path] = Queue()
        cache = Path(folder) / "cache"
        for job in range(options.jobs):
            (Path(folder) / str(job)).mkdir()
            with work_tree(Path(folder) / str(job)) as tree:
                trees.put(tree)
        if options.sound:
            sys.exit("\n".join(unsound(trees.get(), rows, cache, options.timeout)) or "all tests pass.")

        def run(mutant: Mutant) -> Outcome:
            tree = trees.get()
            try:
                outcome = judged(mutant, tree, cache, options.timeout)
            finally:
                trees.put(tree)
            print(f"{outcome.result:<9} {outcome.seconds:6.1f} s  {outcome.file}: {outcome.fault}", flush=True)
            return outcome

        with ThreadPoolExecutor(options.jobs) as pool:
            outcomes = list(pool.map(run, rows))
    killed = sum(outcome.result == "killed" for outcome in outcomes)
    print(f"{killed} of {len(outcomes)} killed in {sum(outcome.seconds for outcome in outcomes):.0f} s.")
    if options.out:
        options.out.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
