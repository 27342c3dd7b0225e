"""A2L of an exported observer against its C, a compiler and a2ltool."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import pytest

from clutchid.exports.a2l import a2l, unit_of
from clutchid.exports.c99 import CStyle
from clutchid.model import Actuator
from clutchid.observer import observer
from clutchid.observer.configuration import Observer
from clutchid.observer.health import FLAGS
from clutchid.observer.state_file import fingerprint
from fixtures.a2l import addresses
from fixtures.export_c import compiled, write_sources
from fixtures.programs import path_of

pytestmark = pytest.mark.slow

TITLE = 'a "quoted" \\ title of 1 m³'


@dataclass(frozen=True)
class Exported:
    """An observer, its A2L, and the folder of its sources."""

    observer: Observer
    style: CStyle
    text: str
    folder: Path

    @property
    def items(self) -> dict[str, str]:
        """Symbols by the names of measurements, characteristics and axes."""
        block = r"/begin (MEASUREMENT|CHARACTERISTIC|AXIS_PTS) (\S+) .*?/end \1"
        matches = re.finditer(block, self.text, re.DOTALL)
        return {m[2]: re.search(r'SYMBOL_LINK "(.+?)" 0', m[0])[1] for m in matches}

    def application(self, statements: str, folder: Path) -> Path:
        """A source with the variables that the A2L names, and a main of some statements."""
        n, name, real = self.observer.joint.mapped.actuator.load.breakpoints.size, self.style.name, self.style.real
        source = folder / "application.c"
        source.write_text(
            f'#include <stdio.h>\n#include "{name}.h"\n#include "{name}_data.c"\n'
            f"{name}_t {name}_observer;\n{name}_output_t {name}_output;\n"
            f"{real} {name}_load_force[{n}], {name}_load_low[{n}], {name}_load_high[{n}];\n"
            f"int main(void)\n{{\n    {statements}\n    return 0;\n}}\n"
        )
        return source


@pytest.fixture(
    scope="module",
    params=[("float", "one", "joint"), ("double", "two", "states")],
    ids="-".join,
)
def exported(request: pytest.FixtureRequest, plant: Actuator, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    real, rates, method = request.param
    style, made = CStyle("release", real, rates), observer(plant, method)
    folder = tmp_path_factory.mktemp("a2l") / "src"
    write_sources(made, style, folder)
    return Exported(made, style, a2l(made, style, TITLE), folder)


def reading(exported: Exported, symbols: Iterator[str]) -> str:
    """Statements that take the first number of each symbol as one of the type in the A2L."""
    real = exported.style.real
    array = re.compile(r"(breakpoints|_load_\w+|weights|epk)$")
    whole = {"epk": "uint8_t", **dict.fromkeys(("strokes", "flags", "trust", "reasons", "health"), "uint32_t")}
    types = {s: whole.get(re.sub(r".*\.|\[.*", "", s), real) for s in symbols}
    return " ".join(
        f"{{ const {t} *at = &{s}{'[0]' if array.search(s) else ''}; (void)*at; }}" for s, t in types.items()
    )


def accepted(source: Path, folder: Path) -> bool:
    """Whether a compiler accepts a source: members, types, and bounds of arrays."""
    options = ("-O2", "-Warray-bounds", "-Werror", "-S", "-o", "/dev/null", f"-I{folder}")
    return subprocess.run([path_of("cc"), *options, str(source)], capture_output=True, check=False).returncode == 0


def test_every_symbol_is_an_element_of_its_type_in_the_c_sources(exported: Exported, tmp_path: Path) -> None:
    symbols = list(dict.fromkeys(exported.items.values()))
    sums = " + ".join(f"(double){s}" for s in symbols if s.endswith(("]", "mean")))
    statements = f'{reading(exported, symbols)} printf("%g", {sums});'
    assert accepted(exported.application(statements, tmp_path), exported.folder)


@pytest.mark.parametrize(
    "spoiled", ["release_output.pressure_c", "release_observer.health[99]", "release_output.flags"]
)
def test_the_compiler_finds_a_wrong_symbol(exported: Exported, tmp_path: Path, spoiled: str) -> None:
    wrong_type = f'const {exported.style.real} *at = &{spoiled}; printf("%g", (double)*at);'
    beyond = f'printf("%g", (double){spoiled});'
    statements = wrong_type if spoiled.endswith("flags") else beyond
    assert not accepted(exported.application(statements, tmp_path), exported.folder)


def test_every_output_is_measured_and_every_acting_parameter_stands_once(exported: Exported) -> None:
    items, joint = exported.items, exported.observer.joint
    header = (exported.folder / "release.h").read_text()
    body = re.search(r"typedef struct \{([^}]*)\} release_output_t;", header)[1]
    fields = re.findall(r"^ +\w+ (\w+);", body, re.MULTILINE)
    assert fields
    assert [n for n, s in items.items() if n == s.replace("_output.", ".")] == [f"release.{field}" for field in fields]
    actuator = joint.mapped.actuator
    adapting = {c.base for c in joint.coordinates}
    calibrated = [n.removeprefix("release.") for n, s in items.items() if s.startswith("release_data.")]
    calibrated.remove("epk")
    assert len(calibrated) == len(set(calibrated))
    free = {f"load.{name}" if name in actuator.load.names else name for name in adapting}
    assert free <= set(calibrated)
    assert set(calibrated) - free <= actuator.acting
    assert actuator.in_equations & actuator.acting <= set(calibrated)


def test_every_value_is_that_of_the_parameter_that_it_names(exported: Exported, tmp_path: Path) -> None:
    shown = {n: s for n, s in exported.items.items() if "_data." in s or ".derived[0].p[" in s}
    assert shown.pop("release.epk") == "release_data.epk"
    printed = " ".join(f'printf("{n} %.9g\\n", (double){s});' for n, s in shown.items())
    main = exported.application(f"release_start(&release_data, &release_observer, NULL, 0u); {printed}", tmp_path)
    others = [f for f in exported.folder.glob("*.c") if f.stem != "release_data"]
    program = compiled([main, *others], tmp_path / "application", f"-I{exported.folder}")
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    actuator = exported.observer.joint.mapped.actuator
    assert len(lines) == len(shown)
    for name, value in map(str.split, lines):
        parameter = name.rpartition(".")[2]
        assert float(value) == pytest.approx(actuator.value(parameter), rel=1e-6, abs=1e-12), name


def test_generator_version_and_hash_stand_in_headers_memory_and_file(exported: Exported, tmp_path: Path) -> None:
    number, calibration = version("clutchid"), fingerprint(exported.observer)
    printed = "static release_nvram_t block[2]; (void)release_store(&release_data, &release_observer, block);"
    printed += (
        r' printf("%s\n%06x %08x", release_data.epk, (unsigned)block[0].generator, (unsigned)block[0].calibration);'
    )
    start = "(void)release_start(&release_data, &release_observer, NULL, 0u);"
    main = exported.application(f"{start} {printed}", tmp_path)
    others = [f for f in exported.folder.glob("*.c") if f.stem != "release_data"]
    program = compiled([main, *others], tmp_path / "application", f"-I{exported.folder}")
    epk, words = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    assert epk == f"release {calibration[:16]} clutchid {number}"
    parts = [int(part) for part in re.findall(r"\d+", number)[:3]]
    assert words == f"{parts[0]:02x}{parts[1]:02x}{parts[2]:02x} {calibration[:8]}"
    assert f'EPK "{epk}"' in exported.text
    assert f'VERSION "clutchid {number}, calibration {calibration[:16]}"' in exported.text
    for header in exported.folder.glob("*.h"):
        assert header.read_text().startswith(f"/* clutchid {number}, calibration {calibration} */\n"), header


def test_the_mask_of_a_flag_has_the_bit_that_it_has_in_c(exported: Exported) -> None:
    header = (exported.folder / "release.h").read_text()
    masks = re.findall(r"MEASUREMENT release\.flag\.(\w+) .*?BIT_MASK 0x([0-9A-F]+)", exported.text, re.DOTALL)
    assert [flag for flag, _ in masks] == list(FLAGS)
    for flag, mask in masks:
        assert f"release_{flag} = {int(mask, 16).bit_length() - 1}," in header
        assert int(mask, 16).bit_count() == 1
        assert exported.items[f"release.samples.{flag}"] == f"release_observer.health[{int(mask, 16).bit_length() - 1}]"


@pytest.mark.parametrize(
    ("first", "other", "alike"),
    [("N·s/m", "N*s/m", True), ("m³/(Pa·s)", "m^3/(Pa*s)", True), ("N·m", "N/m", False), ("1/m", "m", False)],
)
def test_units_share_a_conversion_only_if_they_are_the_same(first: str, other: str, alike: bool) -> None:
    assert (unit_of(first).name == unit_of(other).name) is alike
    assert (unit_of(first) == unit_of(other)) is alike


def test_names_limits_and_references_are_sound(exported: Exported) -> None:
    text = exported.text
    assert text.isascii()
    assert '"a \\"quoted\\" \\\\ title of 1 m^3"' in text
    heads = re.findall(r"/begin (MEASUREMENT|CHARACTERISTIC|AXIS_PTS|COMPU_METHOD|RECORD_LAYOUT) (\S+)", text)
    assert len(heads) == len(set(heads))
    named = dict.fromkeys(name for _, name in heads)
    limits = re.findall(r"(release\.\w+)(?: 0 0)?(?: \d+)? (\S+) (\S+)$", text, re.MULTILINE)
    assert len(limits) >= len(exported.items)
    assert all(float(low) < float(high) for _, low, high in limits)
    assert {method for method, _, _ in limits} <= set(named)
    listed = re.findall(r"^ {8}(release\.\S+)$", text, re.MULTILINE)
    assert sorted(listed) == sorted(exported.items)


def test_units_are_those_of_a_workshop(exported: Exported) -> None:
    assert re.search(r"MEASUREMENT release\.pressure_a .* release\.kPa 0 0 0 1\d{3}", exported.text)
    assert 'release.mm "" LINEAR "%12.6" "mm"\n      COEFFS_LINEAR 1000 0' in exported.text
    assert 'release.kPa "" LINEAR "%12.6" "kPa"\n      COEFFS_LINEAR 0.001 0' in exported.text
    assert re.search(r"VALUE 0x0 release\.value 0 release\.dm3_s_bar 0 1000\n", exported.text)


def test_the_calibration_can_stand_in_a_section_of_its_own(exported: Exported, tmp_path: Path) -> None:
    data, placed = exported.folder / "release_data.c", tmp_path / "data.o"
    section = """-DRELEASE_CALIBRATION=__attribute__((section(".calibration")))"""
    for option, expected in (("-DNONE", False), (section, True)):
        subprocess.run([path_of("cc"), "-c", option, "-o", str(placed), str(data)], check=True)
        table = subprocess.check_output([path_of("objdump"), "-t", str(placed)], text=True)
        line = next(line for line in table.splitlines() if line.endswith(" release_data"))
        assert (".calibration" in line) is expected


a2ltool = pytest.mark.needs("a2ltool")


def run_a2ltool(*options: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([path_of("a2ltool"), *map(str, options)], capture_output=True, text=True, check=False)


@a2ltool
def test_a2ltool_finds_no_problem(exported: Exported, tmp_path: Path) -> None:
    file = tmp_path / "release.a2l"
    file.write_text(exported.text)
    process = run_a2ltool("--strict", "--check", file)
    assert process.returncode == 0
    assert "No problems found" in process.stdout


SPOILERS: dict[str, Callable[[str], str]] = {
    "unknown unit": lambda text: text.replace("COMPU_METHOD release.mm ", "COMPU_METHOD release.cm "),
    "misspelt keyword": lambda text: text.replace("SYMBOL_LINK", "SYMBOL_LNK", 1),
    "unknown axis": lambda text: text.replace("AXIS_PTS_REF release.load_position", "AXIS_PTS_REF release.nothing"),
    "block without an end": lambda text: text.replace("/end MEASUREMENT", "", 1),
}


@a2ltool
@pytest.mark.parametrize("spoil", SPOILERS.values(), ids=SPOILERS)
def test_a2ltool_finds_a_spoiled_file(exported: Exported, tmp_path: Path, spoil: Callable[[str], str]) -> None:
    file, spoiled = tmp_path / "release.a2l", spoil(exported.text)
    assert spoiled != exported.text
    file.write_text(spoiled)
    process = run_a2ltool("--strict", "--check", file)
    assert process.returncode != 0 or "No problems found" not in process.stdout


@a2ltool
def test_addresses_from_an_elf_file_are_those_of_the_program(exported: Exported, tmp_path: Path) -> None:
    items, name = exported.items, exported.style.name
    used = f"{name}_start(&{name}_data, &{name}_observer, NULL, 0u);"
    printed = " ".join(f'printf("%s %lx\\n", "{n}", (unsigned long)&{s});' for n, s in items.items())
    main = exported.application(f"{used} {printed}", tmp_path)
    others = [f for f in exported.folder.glob("*.c") if f.stem != f"{name}_data"]
    program = compiled([main, *others], tmp_path / "application", "-g", "-no-pie", f"-I{exported.folder}")
    run = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    truth = {n: int(at, 16) for n, at in map(str.split, run.stdout.splitlines())}
    file, filled = tmp_path / "release.a2l", tmp_path / "filled.a2l"
    file.write_text(exported.text)
    for update in ("FULL", "ADDRESSES"):
        strict = ("--strict", "--update", update, "--update-mode", "STRICT", "--elffile", program)
        process = run_a2ltool(*strict, "--output", filled, file)
        assert (process.returncode, process.stderr) == (0, "")
        text = filled.read_text()
        assert addresses(text) == truth
        # three numbers, as ASAP2 1.6 and its readers want them, after an update too
        assert re.findall(r"MATRIX_DIM (.*)", text) == re.findall(r"MATRIX_DIM (\d+ 1 1)", exported.text) != []
    listed = map(str.split, subprocess.check_output([path_of("nm"), str(program)], text=True).splitlines())
    symbols = {line[2]: int(line[0], 16) for line in listed if len(line) == 3}
    assert addresses(text)[f"{name}.load_position"] == symbols[f"{name}_breakpoints"]
    assert addresses(text)[f"{name}.pressure_a"] == symbols[f"{name}_output"]
    file.write_text(exported.text.replace("_output.pressure_a_std", "_output.pressure_a_sd"))
    assert run_a2ltool(*strict, "--output", filled, file).returncode != 0
