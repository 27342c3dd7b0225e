"""An exported observer in Simulink against the C program that replays a recording."""

from __future__ import annotations

import ctypes
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from clutchid.exports.c99 import CStyle
from clutchid.exports.matlab import matlab_files
from clutchid.exports.outputs import OUTPUTS
from clutchid.exports.parity import BAND
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.log import FloatArray
from clutchid.model import Actuator
from clutchid.observer import observer
from fixtures.export_c import STRICT, compiled, replay, write_sources
from fixtures.programs import path_of

pytestmark = pytest.mark.slow

#: Time since a period of the valves' carrier began at the first sample, in us.
BEGINS = 3000

POSITIONS = np.linspace(0.0, 0.024, 7)


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
    calibration = Calibration((), np.zeros((0, 0)), conditions=RecordedConditions(temperature=290.0))
    made = observer(plant.replace(T_pwm=0.01), calibration=calibration)
    sources = write_sources(made, style, folder / "src")
    (folder / "matlab").mkdir()
    for file, text in matlab_files(style).items():
        (folder / "matlab" / file).write_text(text)
    log = recorded_by(plant, seconds=3.0)
    steps = np.diff(np.round(log.time * 1e6), prepend=np.round(log.time[0] * 1e6))
    supply, air = np.full((2, len(log)), np.nan)
    air[::100] = 270.0
    samples = np.column_stack([log["position"], log["duty_supply"], log["duty_exhaust"], supply, air, steps])
    program = replay(style, sources, POSITIONS, BEGINS)
    numbers = np.frombuffer(subprocess.run([program], input=samples.tobytes(), stdout=-1, check=True).stdout)
    results, rest = np.split(numbers, [len(log) * len(OUTPUTS)])
    load = rest[: BAND * POSITIONS.size].reshape(-1, BAND)[:, :3]
    samples[:, 5] *= 1e-6
    return Exported(style, folder, sources, samples, results.reshape(len(log), -1), load)


def test_the_outputs_are_the_fields_in_c_in_their_order(exported: Exported) -> None:
    header = (exported.folder / "src" / "release.h").read_text()
    body = re.search(r"typedef struct \{([^}]*)\} release_output_t;", header)[1]
    assert re.findall(r"^ +\w+ (\w+);", body, re.MULTILINE) == list(OUTPUTS)


#: What an S-function of one sample time and one work vector asks of Simulink, with a block for each `SimStruct`.
SIMSTRUC = """
#include <stdlib.h>
typedef double real_T;
typedef int int_T;
typedef struct { double value; } mxArray;
typedef struct {
    int parameters, widths[2], outputs[2], work;
    mxArray given[2];
    double sample_time, *memory, *in[2], *out[2];
} SimStruct;
enum { SS_DOUBLE, SS_OPTION_EXCEPTION_FREE_CODE };
#define mxGetScalar(a) ((a)->value)
#define ssGetSFcnParam(S, i) (&(S)->given[i])
#define ssSetNumSFcnParams(S, n) ((S)->parameters = (n))
#define ssGetNumSFcnParams(S) ((S)->parameters)
#define ssGetSFcnParamsCount(S) 2
#define ssSetSFcnParamTunable(S, i, on) ((void)(S))
#define ssSetNumContStates(S, n) ((void)(S))
#define ssSetNumDiscStates(S, n) ((void)(S))
#define ssSetNumInputPorts(S, n) ((n) == 2)
#define ssSetNumOutputPorts(S, n) ((n) == 2)
#define ssSetInputPortWidth(S, i, n) ((S)->widths[i] = (n))
#define ssSetInputPortRequiredContiguous(S, i, on) ((void)(S))
#define ssSetInputPortDirectFeedThrough(S, i, on) ((void)(S))
#define ssSetOutputPortWidth(S, i, n) ((S)->outputs[i] = (n))
#define ssSetNumSampleTimes(S, n) ((void)(S))
#define ssSetNumDWork(S, n) ((void)(S))
#define ssSetDWorkWidth(S, i, n) ((S)->work = (n))
#define ssSetDWorkDataType(S, i, type) ((void)(S))
#define ssSetOptions(S, options) ((void)(S))
#define ssSetSampleTime(S, i, t) ((S)->sample_time = (t))
#define ssSetOffsetTime(S, i, t) ((void)(S))
#define ssGetDWork(S, i) ((void *)(S)->memory)
#define ssGetInputPortSignal(S, i) ((const void *)(S)->in[i])
#define ssGetOutputPortSignal(S, i) ((void *)(S)->out[i])
"""

SIMULINK = """
SimStruct *block(double sample_time, double begins);
void step(SimStruct *S, double *u, double *position, double *y, double *load);
SimStruct *block(double sample_time, double begins)
{
    SimStruct *S = calloc(1u, sizeof(*S));
    S->given[0].value = sample_time;
    S->given[1].value = begins;
    mdlInitializeSizes(S);
    mdlInitializeSampleTimes(S);
    S->memory = calloc((size_t)S->work, sizeof(double));
    mdlStart(S);
    mdlTerminate(S);
    return S;
}
void step(SimStruct *S, double *u, double *position, double *y, double *load)
{
    S->in[0] = u; S->in[1] = position; S->out[0] = y; S->out[1] = load;
    mdlOutputs(S, 0);
}
"""


def test_two_blocks_of_simulink_have_the_numbers_of_two_programs_bit_for_bit(
    exported: Exported, tmp_path: Path
) -> None:
    """In turn, in one model: the second one begins 500 samples later in the recording."""
    for file, text in {"simstruc.h": SIMSTRUC, "simulink.c": SIMULINK}.items():
        (tmp_path / file).write_text(text)
    options = ("-DMATLAB_MEX_FILE", f"-I{tmp_path}", f"-I{exported.folder / 'src'}", *STRICT, "-shared", "-fPIC")
    sources = [exported.folder / "matlab" / "release_sfun.c", *exported.sources]
    library = ctypes.CDLL(str(compiled(sources, tmp_path / "simulink.so", *options)))
    library.block.restype = ctypes.c_void_p
    begins = ctypes.c_double(BEGINS * 1e-6)
    blocks = [ctypes.c_void_p(library.block(ctypes.c_double(1e-3), begins)) for _ in range(2)]
    recordings = [exported.samples, exported.samples[500:]]
    results, load = np.full((2, len(exported.samples), len(OUTPUTS)), np.nan), np.zeros((2, 3))
    for i in range(len(recordings[0])):
        for number in (number for number in range(2) if i < len(recordings[number])):
            position = POSITIONS[i % POSITIONS.size : i % POSITIONS.size + 1]
            sample = np.ascontiguousarray(recordings[number][i])
            arrays = (sample, position, results[number, i], load[number])
            library.step(blocks[number], *map(pointer, arrays))
    np.testing.assert_array_equal(results[0], exported.results)
    steps = np.append(0.0, np.full(len(recordings[1]) - 1, 1000.0))
    program, samples = exported.folder / "src" / "replay", np.column_stack([recordings[1][:, :5], steps])
    alone = np.frombuffer(subprocess.run([program], input=samples.tobytes(), stdout=-1, check=True).stdout)
    alone = alone[: len(samples) * len(OUTPUTS)].reshape(len(samples), -1)
    np.testing.assert_array_equal(results[1, : len(samples)], alone)
    np.testing.assert_array_equal(load[0], exported.load[(len(exported.samples) - 1) % POSITIONS.size])
    assert np.isfinite(results[0, -1, 0])


def pointer(values: FloatArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


@pytest.mark.needs("octave-cli")
def test_the_build_of_the_s_function_names_files_that_are_there(exported: Exported, tmp_path: Path) -> None:
    """In the folder of the script, wherever it is called."""
    (tmp_path / "mex.m").write_text(
        "function mex(varargin)\n"
        "for file = varargin(4:end), assert(exist(fullfile(pwd, file{1}), 'file') == 2); end\n"
        "assert(strcmp(varargin(1:2), {'-I../src', '-output'}));\n"
        "end\n"
    )
    for name, result in (("new_system", "m = 1"), ("open_system", ""), ("get_param", "m = 'model'"), ("set_param", "")):
        head = f"function {'m = ' if result else ''}{name}(varargin)\n{result};\nend\n"
        (tmp_path / f"{name}.m").write_text(head)
    (tmp_path / "add_block.m").write_text(
        "function add_block(varargin)\nassert(isequal(str2num(varargin{end}), [2e-3, 0]));\n"
        "assert(strcmp(varargin{4}, 'release_sfun'));\nend\n"
    )
    statements = f"addpath('{exported.folder / 'matlab'}', pwd); make_sfunction(2e-3);"
    subprocess.run([path_of("octave-cli"), "--norc", "--quiet", "--eval", statements], cwd=tmp_path, check=True)
