"""Time to write the page of a fleet of drawn vehicles, and to open, sort and search it in Chromium without a window.

Usage: python benchmarks/fleet_page.py [--vehicles 10000,100000]

Medians of five times. Opened is from the start of loading until the first rows are laid out; sorted is by what is left,
searched for a part of a name. Vehicles have drawn numbers and no files.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import tempfile
from base64 import b64encode
from datetime import UTC, datetime
from hashlib import sha256
from html import unescape
from pathlib import Path
from time import process_time

import numpy as np

from clutchid.documents import document_of, write_page
from clutchid.documents.fleet_tables import ReplacementRow, VehicleRow
from clutchid.documents.results import FleetWear
from clutchid.documents.wear_rows import alarm_words
from clutchid.wear import Alarm, Interval
from clutchid.wear.due import FORECAST_MONTHS

#: Script that puts the milliseconds to open, sort and search into the title of the page.
TIMED = """addEventListener("load", () => {
const laid = () => (document.body.offsetHeight, performance.now());
const times = [laid()];
const timed = (act) => { const start = performance.now(); act(); times.push(laid() - start); };
const buttons = Array.from(document.querySelectorAll(".sortable thead button"));
timed(() => buttons.find((one) => one.textContent === "median").click());
timed(() => { location.hash = "filter=777"; dispatchEvent(new HashChangeEvent("hashchange")); });
document.title = JSON.stringify([...times, document.querySelectorAll(".sortable tbody tr").length]);
})"""


def vehicles_of(count: int) -> list[VehicleRow]:
    """Vehicles with all numbers, one in a hundred with an alarm."""
    rng = np.random.default_rng(1)
    rates, shifts, lefts = np.exp(0.3 * rng.standard_normal((3, count)))
    rows = []
    for k, (rate, shift, left) in enumerate(zip(rates.tolist(), shifts.tolist(), lefts.tolist(), strict=True)):
        bands = (Interval(left * usual, 0.6 * left * usual, 1.5 * left * usual) for usual in (4e5, 500.0, 2e5))
        share = float(np.exp(-3.0 * left))
        strokes, days, km = bands
        row = VehicleRow(
            f"truck {k:06d}", f"type {k % 12}", 52, 50, {"ok": 50, "failed": 2}, datetime(2026, 5, 1, tzinfo=UTC),
            Interval(2e-4 * shift, 1.8e-4 * shift, 2.2e-4 * shift), Interval(0.02, -0.01, 0.05),
            Interval(*[float("nan")] * 3), 1e-9 * rate, strokes, "strokes", page=f"vehicles/truck {k:06d}.html",
            limit=1e-3, left_days=days, left_km=km, within=(share,) * 6, by_month=(share,) * FORECAST_MONTHS,
        )  # fmt: skip
        events = (Alarm("r1", "r2", row.last, "sudden", 1e-4, 0.05, probability=0.95 + 0.05 * share),) * (k % 100 == 0)
        rows.append(row._replace(alarms=tuple(map(alarm_words, events)), events=events))
    return rows


def times(path: Path, folder: Path) -> list[float]:
    """Milliseconds to open, sort and search, and the number of rows that the page then has."""
    html = path.read_text("utf-8")
    digest = b64encode(sha256(TIMED.encode()).digest()).decode()
    html = html.replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    timed = folder / "timed.html"
    timed.write_text(html.replace("</body>", f"<script>{TIMED}</script></body>"), "utf-8")
    chromium = shutil.which("chromium") or shutil.which("google-chrome") or "chromium"
    options = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}", "--dump-dom")
    command = [chromium, *options, timed.as_uri()]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    title = re.search("<title>(.*?)</title>", text, re.DOTALL)
    assert title, "the page has no title"
    return list(json.loads(unescape(title[1])))


def main() -> None:
    """Print a row of a table for each number of vehicles."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", default="10000,100000")
    print(
        "| vehicles | written, processor [s] | size [MB] | opened [s] | sorted [s] | searched [s] | rows on the page |"
    )
    for count in map(int, parser.parse_args().vehicles.split(",")):
        months = [
            ReplacementRow("", "", month, count / 50, count / 60, count / 40) for month in range(1, FORECAST_MONTHS + 1)
        ]
        fleet = FleetWear(vehicles_of(count), (), (), months)
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "index.html"
            start = process_time()
            write_page(document_of(fleet, "clutchid fleet"), path)
            written, size = process_time() - start, path.stat().st_size / 1e6
            opened, sort, search, rows = np.median([times(path, Path(name)) for _ in range(5)], axis=0)
        numbers = " | ".join(f"{value:.2f}" for value in (written, size, 1e-3 * opened, 1e-3 * sort, 1e-3 * search))
        print(f"| {count:,} | {numbers} | {rows:.0f} |", flush=True)


if __name__ == "__main__":
    main()
