"""An exported observer on a control unit: it builds, and has the outputs that it must have."""

import re
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle
from clutchid.exports.parity import samples_of
from clutchid.exports.requirements import requirement_files
from clutchid.exports.target import OUTPUTS, example_files, vectors
from clutchid.log import FloatArray, Log
from clutchid.model import Actuator
from clutchid.observer import observer
from clutchid.observer.configuration import Observer
from fixtures.export_c import write_sources
from fixtures.programs import path_of

pytestmark = [
    pytest.mark.slow,
    pytest.mark.needs("make", "cc"),
]
ON_TARGET = pytest.mark.needs("arm-none-eabi-gcc", "qemu-system-arm")
STYLES = [CStyle("unit", real, rates) for real in ("float", "double") for rates in ("one", "two")]
STRICT = "CFLAGS=-O1 -Werror"


def written(folder: Path, observed: Observer, style: CStyle) -> Path:
    """The export with its example in a folder."""
    write_sources(observed, style, folder / "src")
    for path, text in (example_files(style) | requirement_files(observed, style)).items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    return folder


def make(folder: Path, *targets: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [path_of("make"), "-C", folder, f"CC={path_of('cc')}", *targets], capture_output=True, text=True, check=False
    )


def outputs_of(folder: Path, style: CStyle, samples: FloatArray) -> FloatArray:
    """What the export itself gives for samples on this computer, without optimisation."""
    program = template("replay.c.j2", "clutchid.exports").render(
        name=style.name, real=style.real, positions=[0.0], begins_us=0, outputs=tuple(OUTPUTS)
    )
    (folder / "replay.c").write_text(program)
    sources = sorted((folder / "src").glob("*.c"))
    command = [
        path_of("cc"),
        "-std=c99",
        "-O0",
        f"-I{folder}/src",
        "-o",
        folder / "replay",
        folder / "replay.c",
        *sources,
        "-lm",
    ]
    subprocess.run(command, check=True)
    process = subprocess.run([folder / "replay"], input=samples.tobytes(), capture_output=True, check=True)
    rows = np.frombuffer(process.stdout)[: len(samples) * len(OUTPUTS)]
    return rows.reshape(len(samples), len(OUTPUTS))


@pytest.fixture(scope="module")
def observed(plant: Actuator) -> Observer:
    return observer(plant)


@pytest.fixture(scope="module")
def samples(recorded_by: Callable[..., Log], plant: Actuator) -> FloatArray:
    return samples_of(recorded_by(plant, seconds=2.0))


@pytest.fixture(scope="module")
def exported(
    observed: Observer, samples: FloatArray, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[CStyle], tuple[Path, FloatArray]]:
    """The folder of an export in a style, and its outputs for the samples."""

    @cache
    def export(style: CStyle) -> tuple[Path, FloatArray]:
        folder = written(tmp_path_factory.mktemp("target"), observed, style)
        return folder, outputs_of(folder, style, samples)

    return export


@pytest.mark.parametrize("style", STYLES[::3], ids=lambda style: f"{style.real}-{style.rates}")
def test_example_and_test_build_without_a_warning_and_the_outputs_agree(
    exported: Callable[[CStyle], tuple[Path, FloatArray]], samples: FloatArray, style: CStyle
) -> None:
    folder, expected = exported(style)
    (folder / "test/vectors.h").write_text(vectors(samples, expected, style))
    built = make(folder / "example", STRICT)
    assert not built.returncode, built.stderr
    ran = subprocess.run([folder / "example/unit_host"], capture_output=True, text=True, check=False)
    assert ran.returncode == 0
    assert ran.stdout.startswith("unit: 1000000 us, 0 strokes")
    tested = make(folder / "test", "-B", STRICT)
    assert not tested.returncode, tested.stdout + tested.stderr
    assert "parity: ok, 2000 samples" in tested.stdout


@pytest.mark.parametrize("output", [0, 3, 5, 8, 9])
def test_one_spoiled_output_is_found(
    exported: Callable[[CStyle], tuple[Path, FloatArray]], samples: FloatArray, output: int
) -> None:
    style = STYLES[0]
    folder, expected = exported(style)
    spoiled = expected.copy()
    spoiled[1509, output] += 1.0 if output > 7 else 0.1 * np.nanmax(np.abs(spoiled[:, output]))
    (folder / "test/vectors.h").write_text(vectors(samples, spoiled, style))
    tested = make(folder / "test", "-B", "CFLAGS=-O0")
    assert tested.returncode
    assert "parity: failed" in tested.stdout
    assert f"{tuple(OUTPUTS)[output]} = " in tested.stdout
    assert "at sample 1509" in tested.stdout


@ON_TARGET
@pytest.mark.parametrize("style", STYLES[:2], ids=lambda style: style.rates)
def test_a_cortex_m4_has_the_outputs_of_this_computer(
    tmp_path: Path, observed: Observer, samples: FloatArray, style: CStyle
) -> None:
    folder = written(tmp_path / "export", observed, style)
    (folder / "test/vectors.h").write_text(vectors(samples, outputs_of(folder, style, samples), style))
    tested = make(folder / "test", "arm", STRICT)
    assert not tested.returncode, tested.stdout + tested.stderr
    assert "parity: ok" in tested.stdout
    ran = make(folder / "example", "run", STRICT)
    # the emulated timer follows the clock of this computer: on a busy one a sample comes before the line is printed
    assert re.search(r"unit: 10\d\d000 us, 0 strokes", ran.stdout), ran.stdout + ran.stderr
