"""An exported observer in MATLAB, Octave and Simulink against the C program that replays a recording."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from clutchid.exports.c99 import CStyle
from clutchid.exports.matlab import matlab_files
from clutchid.exports.outputs import OUTPUTS
from clutchid.exports.parity import BAND
from clutchid.log import FloatArray
from clutchid.model import Actuator
from clutchid.observer import observer
from fixtures.export_c import STRICT, compiled, replay, write_sources

pytestmark = pytest.mark.slow

#: Time since a period of the valves' carrier began at the first sample, in us.
BEGINS = 3000

POSITIONS = np.linspace(0.0, 0.024, 7)

octave = pytest.mark.skipif(shutil.which("mkoctfile") is None, reason="Octave with mkoctfile is not installed")


@dataclass(frozen=True)
class Exported:
    """Folders ``src`` and ``matlab`` of an export; a recording, its results and load as the C program has them."""

    style: CStyle
    folder: Path
    sources: list[Path]
    samples: FloatArray
    results: FloatArray
    load: FloatArray


@pytest.fixture(scope="module", params=[("float", "one"), ("double", "two")], ids="-".join)
def exported(request, plant: Actuator, recorded_by, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    style, folder = CStyle("release", *request.param), tmp_path_factory.mktemp("matlab") / "with space"
    folder.mkdir()
    made = observer(plant.replace(T_pwm=0.01))
    sources = write_sources(made, style, folder / "src")
    (folder / "matlab").mkdir()
    for file, text in matlab_files(style).items():
        (folder / "matlab" / file).write_text(text)
    log = recorded_by(plant, seconds=3.0)
    steps = np.diff(np.round(log.time * 1e6), prepend=np.round(log.time[0] * 1e6))
    supply = np.full(len(log), np.nan)
    samples = np.column_stack([log["position"], log["duty_supply"], log["duty_exhaust"], supply, steps])
    program = replay(style, sources, POSITIONS, BEGINS)
    numbers = np.frombuffer(subprocess.run([program], input=samples.tobytes(), stdout=-1, check=True).stdout)
    results, rest = np.split(numbers, [len(log) * len(OUTPUTS)])
    load = rest[: BAND * POSITIONS.size].reshape(-1, BAND)[:, :3]
    samples[:, 4] *= 1e-6
    return Exported(style, folder, sources, samples, results.reshape(len(log), -1), load)


def test_the_outputs_are_the_fields_in_c_in_their_order(exported: Exported) -> None:
    header = (exported.folder / "src" / "release.h").read_text()
    body = re.search(r"typedef struct \{([^}]*)\} release_output_t;", header)[1]
    assert re.findall(r"^ +\w+ (\w+);", body, re.MULTILINE) == list(OUTPUTS)


def test_the_functions_for_simulink_have_the_numbers_of_the_replay_bit_for_bit(exported: Exported) -> None:
    matlab, inputs = exported.folder / "matlab", f"-I{exported.folder / 'src'}"
    subprocess.run(["gcc", *STRICT, "-fsyntax-only", inputs, str(matlab / "release_simulink.c")], check=True)
    file = exported.folder / "simulink.so"
    compiled([matlab / "release_simulink.c", *exported.sources], file, "-shared", "-fPIC", inputs)
    library = ctypes.CDLL(str(file))
    results, load = np.full((len(exported.samples), len(OUTPUTS)), np.nan), np.full((POSITIONS.size, 3), np.nan)
    for _ in range(2):  # it begins anew
        library.release_simulink_init(ctypes.c_double(BEGINS * 1e-6))
        for sample, result in zip(exported.samples, results, strict=True):
            library.release_simulink_step(pointer(sample), ctypes.c_double(sample[4]), pointer(result))
        for position, band in zip(POSITIONS, load, strict=True):
            library.release_simulink_load(ctypes.c_double(position), pointer(band))
        np.testing.assert_array_equal(results, exported.results)
        np.testing.assert_array_equal(load, exported.load)
    assert np.isfinite(results[-1, 0])


def pointer(values: FloatArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


def test_the_specification_of_the_s_function_calls_what_the_header_declares(exported: Exported, tmp_path: Path) -> None:
    text = (exported.folder / "matlab" / "make_sfunction.m").read_text().replace("' ...\n    '", "")
    calls = re.findall(r"FcnSpec = \[?'void (\w+)\((.*)\)'\]?;", text)
    assert [name for name, _ in calls] == ["release_simulink_init", "release_simulink_sample"]
    wrapped = [
        f"void wrapped_{name}({arguments});\nvoid wrapped_{name}({arguments})\n"
        f"{{ {name}({', '.join(re.findall(r'[uyp][0-9]', arguments))}); }}"
        for name, arguments in calls
    ]
    source = tmp_path / "wrapped.c"
    source.write_text("\n".join(['#include "release_simulink.h"', *wrapped]))
    options = ("-O2", *STRICT, f"-I{exported.folder / 'matlab'}", "-c", "-o", "/dev/null")
    subprocess.run(["gcc", *options, str(source)], check=True)


def run_octave(folder: Path, statements: str) -> None:
    subprocess.run(
        ["octave-cli", "--norc", "--quiet", "--eval", statements], cwd=folder, check=True, capture_output=True
    )


@octave
def test_the_mex_function_has_the_numbers_of_the_replay_bit_for_bit(exported: Exported, tmp_path: Path) -> None:
    exported.samples.T.tofile(tmp_path / "samples")
    POSITIONS.tofile(tmp_path / "positions")
    run_octave(
        tmp_path,
        f"addpath('{exported.folder / 'matlab'}'); make_mex();"
        "function x = get(name, n), f = fopen(name); x = fread(f, [n, Inf], 'double'); fclose(f); end;"
        "function put(name, x), f = fopen(name, 'w'); fwrite(f, x', 'double'); fclose(f); end;"
        f"samples = reshape(get('samples', 1), {len(exported.samples)}, 5);"
        f"[y, load] = release_mex(samples, get('positions', 1), {BEGINS * 1e-6});"
        "put('y', y); put('load', load);"
        f"assert(isequaln(release_mex(samples, [], {BEGINS * 1e-6}), y));"
        "assert(! isequaln(release_mex(samples), y));",
    )
    np.testing.assert_array_equal(np.fromfile(tmp_path / "y").reshape(-1, len(OUTPUTS)), exported.results)
    np.testing.assert_array_equal(np.fromfile(tmp_path / "load").reshape(-1, 3), exported.load)
    refused = ("", "1", "zeros(2, 4)", "single(zeros(2, 5))", "1i * ones(2, 5)", "zeros(2, 5), 0, [1 2]")
    run_octave(
        exported.folder / "matlab",
        "refused = {" + ", ".join(f"@() release_mex({arguments})" for arguments in refused) + "};"
        "for k = 1:numel(refused), ok = false; try, refused{k}(); catch e, "
        "ok = strcmp(e.identifier, 'clutchid:release'); end; assert(ok); end",
    )
    assert sorted(f.name for f in tmp_path.iterdir()) == ["load", "positions", "samples", "y"]
    built = {f.name for f in (exported.folder / "matlab").iterdir()} - matlab_files(exported.style).keys()
    assert built == {"release_mex.mex"}


@octave
def test_the_build_of_the_s_function_names_files_that_are_there(exported: Exported, tmp_path: Path) -> None:
    (tmp_path / "legacy_code.m").write_text(
        "function def = legacy_code(action, def)\n"
        "if strcmp(action, 'initialize'), def = struct(); return; end\n"
        "for file = [def.SourceFiles, def.HeaderFiles]\n"
        "  assert(any(cellfun(@(folder) exist(fullfile(folder, file{1}), 'file') == 2, def.SrcPaths)));\n"
        "end\n"
        "assert(def.SampleTime == 2e-3);\n"
        "f = fopen('actions', 'a'); fprintf(f, '%s\\n', action); fclose(f);\n"
        "end\n"
    )
    run_octave(tmp_path, f"addpath('{exported.folder / 'matlab'}'); make_sfunction(2e-3);")
    actions = ["sfcn_cmex_generate", "compile", "sfcn_tlc_generate", "rtwmakecfg_generate", "slblock_generate"]
    assert (tmp_path / "actions").read_text().split() == actions
