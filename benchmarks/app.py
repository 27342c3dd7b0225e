"""What the page costs: ``python benchmarks/app.py [--stages] [--megabytes 100 500]``.

A server as a process of its own, Debian's Chromium by Playwright (needs the package playwright, and chromium on the
path), and recordings that are written first. Printed are times, and the memory of server and tab, with their targets.
``--stages`` prints instead what each stage of a calibration and of an estimate takes, see
`clutchid.workflow.progress`.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from clutchid import Fit, calibrate, estimate, parameter_file, write
from clutchid.numerics.progress import Progress, Step
from clutchid.truck import Truck, drive


def long_recording(path: Path, megabytes: float) -> int:
    """Write a CSV file of about this size, by repeating a recording; its samples."""
    log = drive(Truck(), seconds=20.0, seed=1).log
    write(log, path)
    head, *rows = path.read_text().splitlines()
    values = [row.partition(",")[2] for row in rows]
    times, written = max(1, round(megabytes * 1e6 / path.stat().st_size)), 0
    with path.open("w") as file:
        file.write(f"{head}\n")
        for _ in range(times):
            file.write("".join(f"{(written + i) / 1e3:.3f},{value}\n" for i, value in enumerate(values)))
            written += len(values)
    return written


@contextmanager
def server(folder: Path) -> Iterator[tuple[psutil.Process, str, float]]:
    """A server; its process, its address, and the time until it was up in s."""
    begin = time.perf_counter()
    command = [sys.executable, "-m", "clutchid", "app", "--no-browser", "--folder", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    try:
        yield psutil.Process(process.pid), address, time.perf_counter() - begin
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)


def row(name: str, value: float, unit: str, target: float) -> None:
    """Print a line of the table."""
    print(f"| {name} | {value:.3g} {unit} | {target:g} {unit} |", flush=True)


def peak(process: psutil.Process) -> float:
    """Most memory of a process so far in MB."""
    for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) / 1e3
    return process.memory_info().rss / 1e6


#: Ask for 0.1 s of four channels around a time; ms until the points are there.
ASK = """async ([number, middle]) => {
  const begin = performance.now();
  const query = new URLSearchParams({
    grid: 0, columns: "1,2,3,4", begin: middle - 0.05, end: middle + 0.05, width: 1400 });
  await (await fetch(`/api/recordings/recording-${number}/plot?${query}`)).arrayBuffer();
  return performance.now() - begin;
}"""

#: Press a key on the strips; ms until they show other times.
ZOOM = """(key) => new Promise((resolve) => {
  const strips = document.querySelector(".strips");
  const begin = performance.now();
  new MutationObserver((_, observer) => { observer.disconnect(); resolve(performance.now() - begin); })
    .observe(strips, { attributeFilter: ["data-shown"] });
  strips.dispatchEvent(new KeyboardEvent("keydown", { key }));
})"""


def page_costs(megabytes: list[float]) -> None:
    """Print the table of the page."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("there is no chromium on the path.")
    print("| what | measured | target |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        write(drive(Truck(), seconds=10.0, seed=1).log, folder / "small.csv")
        samples = {size: long_recording(folder / f"{size:g}.csv", size) for size in megabytes}
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 950})
        page.set_default_timeout(300_000)
        with server(folder) as (process, address, up):
            row("server up", up, "s", 1.5)
            begin = time.perf_counter()
            page.goto(address)
            page.locator(".empty").wait_for()
            row("page shown", time.perf_counter() - begin, "s", 1.0)
            time.sleep(5.0)  # the spare process has its imports
            number = 0
            for what, file, target in (
                ("first plot of 0.3 MB", "small.csv", 0.3),
                *((f"first plot of {size:g} MB", f"{size:g}.csv", 4.0 if size <= 100 else 15.0) for size in megabytes),
            ):
                number += 1
                begin = time.perf_counter()
                page.set_input_files("#files", str(folder / file))
                page.locator(f"#item-recording-{number}.chosen").wait_for()
                page.locator(f".details[data-of='recording-{number}'] .strips[data-shown]").wait_for()
                row(what, time.perf_counter() - begin, "s", target)
                page.locator(f"#item-recording-{number} .dot:is(.good, .suspect, .bad)").wait_for()
                time.sleep(4.0)
            largest = max(samples.values(), default=10_000)
            end = largest / 1e3
            taken = [page.evaluate(ASK, [number, end * (k + 0.5) / 20]) for k in range(20)]
            row(f"samples of a zoom arrive, of {largest / 1e6:.1f} million", float(np.median(taken)), "ms", 50.0)
            taken = [page.evaluate(ZOOM, key) for key in "+" * 16]
            row("zoom drawn", float(np.median(taken)), "ms", 50.0)
            row("server, most memory", peak(process), "MB", 110.0)
            heap = page.evaluate("performance.memory ? performance.memory.usedJSHeapSize / 1e6 : NaN")
            row("tab, memory of JavaScript", heap, "MB", 200.0)
            cancel(page, process)
        browser.close()


def cancel(page: Any, process: psutil.Process) -> None:
    """Cancel a calibration that runs, and look for what is left of it."""
    page.click("#item-recording-1")
    page.click("nav a[href='#load']")
    page.click("#run-calibrate")
    page.locator("footer progress[value]").wait_for()
    running = {child.pid for child in process.children(recursive=True)}
    begin = time.perf_counter()
    page.click("footer button:has-text('Cancel')")
    page.locator(".board .badge", has_text="stopped").wait_for()
    row("cancelled", time.perf_counter() - begin, "s", 0.3)
    time.sleep(0.5)
    left = [child for child in process.children(recursive=True) if child.pid in running and child.status() != "zombie"]
    busy = [child for child in left if child.cpu_percent(0.5) > 50.0]
    row("processes of it that still run", len(busy), "", 0)


def stages() -> None:
    """Print what each stage of a calibration and of an estimate takes."""
    cal, worn = (drive(Truck(), seconds=10.0, seed=seed).log for seed in (1, 2))
    calibrate(cal.slice(0, 4000))  # compiled, and its imports done
    print("| verb | stage | s | evaluations |\n|---|---|---|---|")
    content = parameter_file(_timed("calibrate", lambda heard: calibrate(cal, progress=heard)))
    _timed("estimate", lambda heard: estimate(worn.without("pressure_a"), content, progress=heard))


def _timed(verb: str, work: Callable[[Progress], Fit]) -> Fit:
    spent: dict[str, list[float]] = {}
    last: list[tuple[float, Step]] = []

    def heard(step: Step) -> None:
        now = time.perf_counter()
        if last:
            before, previous = last.pop()
            entry = spent.setdefault(previous.stage, [0.0, 0.0])
            entry[0] += now - before
            entry[1] = max(entry[1], previous.evaluations)
        last.append((now, step))

    result = work(heard)
    heard(Step("writing"))
    for stage, (seconds, evaluations) in spent.items():
        print(f"| {verb} | {stage} | {seconds:.2f} | {evaluations:.0f} |")
    return result


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stages", action="store_true")
    parser.add_argument("--megabytes", type=float, nargs="*", default=[100.0])
    arguments = parser.parse_args()
    stages() if arguments.stages else page_costs(arguments.megabytes)


if __name__ == "__main__":
    main()
