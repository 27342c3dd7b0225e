"""No tracked file names an address of a package registry, and the bill of materials is made from names and versions."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from fixtures.programs import path_of

ROOT = Path(__file__).resolve().parents[2]

#: Addresses, in pieces.
WEB = "https:" + "//"
ADDRESSES = (
    WEB + "py" + "pi.org/project/numpy", "files.python" + "hosted.org", WEB + "registry.npm" + "js.org/uplot",
    "source = { regis" + f"try = \"{WEB}mirror.example.com/a\" }}", "--extra-index" + f"-url {WEB}10.0.0.1:8080/a",
    f"{WEB}10.0.0.1:8080/pool/simp" + "le/numpy", f"{WEB}example.com/numpy-2.0-py3-none-any.wh" + "l#sha256=1",
    "index" + f"-url = {WEB}dev" + "pi.example.com/x", f"{WEB}arti" + "factory.example.com/a",
)  # fmt: skip

#: Words and addresses that name none.
WORDS = (
    "pip install -c constraints.txt '.[can]'", "no registry filled on import", "numpy==2.0", "pkg:pypi/numpy@2.0",
    f"{WEB}github.com/dequelabs/axe-core", f"{WEB}mozilla.org/MPL/2.0/", f"{WEB}numpy.org/doc/stable/simple.html",
    "environment: pypi", f"{WEB}example.com/data.csv.gz",
)  # fmt: skip


def checked(folder, text):
    """What the lint says of a tracked file with this text."""
    subprocess.run([path_of("git"), "init", "-q", folder], check=True)
    (folder / "notes.md").write_text(f"See {text}\n")
    subprocess.run([path_of("git"), "-C", folder, "add", "notes.md"], check=True)
    return subprocess.run(
        [path_of("bash"), ROOT / ".ci" / "addresses"], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("text", ADDRESSES)
def test_an_address_of_a_registry_is_found(tmp_path, text):
    process = checked(tmp_path, text)
    assert (process.returncode, process.stdout.partition(":")[0]) == (1, "notes.md")


def test_what_is_no_address_passes(tmp_path):
    process = checked(tmp_path, "\n".join(WORDS))
    assert (process.returncode, process.stdout) == (0, "")


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="the repository is needed.")
def test_no_tracked_file_names_one():
    process = subprocess.run(
        [path_of("bash"), ROOT / ".ci" / "addresses"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (process.returncode, process.stdout) == (0, "")
    assert ".ci/addresses" in (ROOT / ".ci" / "lint").read_text()


def test_the_bill_of_materials_has_every_library_and_names_what_lacks_a_version(tmp_path):
    def written(folder):
        return subprocess.run(
            [sys.executable, ROOT / ".ci" / "sbom", folder], capture_output=True, text=True, check=False
        )

    content = json.loads(written(ROOT).stdout)
    assert (content["bomFormat"], content["specVersion"]) == ("CycloneDX", "1.5")
    pins = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line]
    assert sorted(f"{component['name']}=={component['version']}" for component in content["components"]) == sorted(pins)
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    (tmp_path / "constraints.txt").write_text("\n".join(pin for pin in pins if not pin.startswith("polars")))
    text = written(tmp_path)
    assert (text.returncode, "has no version of polars" in text.stderr) == (1, True)
    assert tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["name"] == "clutchid"
