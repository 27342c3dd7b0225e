"""The page in a browser: a server in a process of its own, and Debian's Chromium.

With CLUTCHID_WRITE_PICTURES=1 the pictures of docs/commands/app.md are written anew.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from clutchid import write
from clutchid.truck import Truck, drive
from fixtures.programs import path_of

PICTURES = Path(__file__).resolve().parents[3] / "docs" / "images"
AXE = (Path(__file__).parent / "vendor" / "axe.min.js").read_text(encoding="utf-8")


def pytest_collection_modifyitems(items):
    for item in items:
        if item.nodeid.startswith("tests/app/pages/"):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="module")
def browser():
    """Chromium without a window; it ends with the file, as its event loop is in the way of others."""
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed: pages are not opened.")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path_of("chromium"), args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """German MDF files of a new clutch and, without pressure, of the worn one; CSV files of both, and a broken one."""
    import asammdf

    folder = tmp_path_factory.mktemp("files")
    log = drive(Truck(), seconds=10.0, seed=1).log
    channels = {
        "Kupplungsweg_Ist": (1e3 * log["position"], "mm"),
        "Tastverhältnis_Belüftung": (100 * log["duty_supply"], "%"),
        "Tastverhältnis_Entlüftung": (100 * log["duty_exhaust"], "%"),
        "Druck_Zylinder": ((log["pressure_a"] - 1.013e5) / 1e5, "bar"),
    }
    slow = np.arange(500) / 50
    for file, names in (("Messung.mf4", [*channels]), ("Verschleiss.mf4", [*channels][:3])):
        with asammdf.MDF(version="4.10") as mdf:
            mdf.append([asammdf.Signal(channels[n][0], log.time, unit=channels[n][1], name=n) for n in names])
            mdf.append([asammdf.Signal(70 + 20 * np.sin(slow), slow, unit="degC", name="Motortemperatur")])
            mdf.save(folder / file)
    write(drive(Truck(), seconds=10.0, seed=2, pressure=False, wear=1.2e-3).log, folder / "worn.csv")
    write(log.slice(0, 5000), folder / "cal.csv")
    (folder / "broken.mf4").write_bytes((folder / "Messung.mf4").read_bytes()[:100])
    (folder / "broken.csv").write_text("time [s],position [m]\n0,0\n0,x\n")
    text = (folder / "worn.csv").read_text().replace("position [m]", "position [m],<img src=x onerror=alert(1)> [1]", 1)
    head, *rows = text.splitlines()
    spoiled = [",".join([*row.split(",")[:2], "0", *row.split(",")[2:]]) for row in rows]
    (folder / "<b>bold<b>.csv").write_text("\n".join([head, *spoiled]) + "\n")
    return folder


@pytest.fixture
def server(files):
    """The address of a server whose folder is that of the files."""
    command = [sys.executable, "-m", "clutchid", "app", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=files)
    yield process.stdout.readline().strip()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 0
    assert said == ""


@pytest.fixture
def page(browser, server):
    """The page as it was opened first; it must ask nothing elsewhere, and report no error."""
    context = browser.new_context(viewport={"width": 1400, "height": 950}, color_scheme="light")
    context.set_default_timeout(180_000)
    tab = context.new_page()
    faults = []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on(
        "console",
        lambda message: faults.append(message.text) if message.type == "error" and "422" not in message.text else None,
    )
    tab.on("dialog", lambda dialog: (faults.append(dialog.message), dialog.dismiss()))
    base = server.partition("/?")[0]
    tab.on(
        "request",
        lambda request: None if request.url.startswith((base, "blob:", "data:")) else faults.append(request.url),
    )
    tab.goto(server)
    tab.locator(".empty").wait_for()
    yield tab
    context.close()
    assert faults == []


@pytest.fixture
def findings(page):
    """What axe-core finds on the page: the rule, and the first element."""

    def find():
        page.evaluate(AXE)
        value = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        return [f"{violation['id']}: {violation['nodes'][0]['html'][:120]}" for violation in value["violations"]]

    return find


@pytest.fixture
def picture():
    """Keep a picture of a page for the documentation, where it is asked for."""

    def take(page, name, **options):
        if os.environ.get("CLUTCHID_WRITE_PICTURES"):
            page.screenshot(path=PICTURES / f"app_{name}.png", **options)

    return take


@pytest.fixture
def opened(page, files):
    """Open a file by upload, and wait until it has been checked."""

    def open_file(name, number=1):
        page.set_input_files("#files", str(files / name))
        page.locator(f"#item-recording-{number} .dot:is(.good, .suspect, .bad)").wait_for()

    return open_file
