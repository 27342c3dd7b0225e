"""Run the compiled kernels over a plan: states, and exact forward sensitivities to chosen parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import ParameterError
from clutchid.log import FloatArray, IntArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import Model, kernels, lanes, parameter_names, state_rows
from clutchid.model.weighted_load import Load
from clutchid.simulation.plan import Segment

#: Names of the unknown start values of a segment among the sensitivities.
POSITION_START, PRESSURE_START = "y_start", "p_A_start"


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Columns of the sensitivities of a run: load weights, parameters and start values, by name."""

    names: tuple[str, ...]
    table_basis: IntArray
    table_column: IntArray
    fill_slot: IntArray
    fill_row: IntArray
    fill_column: IntArray


def columns(actuator: Actuator, names: Sequence[str]) -> Columns:
    """Columns of the sensitivities to `names`: parameters, load weights, `POSITION_START`, `PRESSURE_START`."""
    return _columns(actuator.model, actuator.load.names, tuple(names))


@lru_cache(maxsize=1024)
def _columns(model: Model, load: tuple[str, ...], names: tuple[str, ...]) -> Columns:
    weights = [(load.index(name), c) for c, name in enumerate(names) if name in load]
    position = {name: number for number, name in enumerate(parameter_names(model))}
    column_of = {position[name]: c for c, name in enumerate(names) if name in position}
    fill = [(slot, row, column_of[q]) for slot, (row, q) in enumerate(kernels(model).SLOTS) if q in column_of]
    table_basis, table_column = _integers(weights, 2)
    return Columns(names, table_basis, table_column, *_integers(fill, 3))


def _integers(rows: Sequence[tuple[int, ...]], width: int) -> list[IntArray]:
    array = np.array(rows, dtype=np.int64).reshape(-1, width)
    return [np.ascontiguousarray(column) for column in array.T]


@dataclass(frozen=True, slots=True, eq=False)
class KernelArrays:
    """Parameters and load tables of an actuator, as arrays for the kernels."""

    parameters: FloatArray
    breakpoints: FloatArray
    basis: FloatArray
    load: FloatArray
    model: Model

    @classmethod
    def of(cls, actuator: Actuator) -> KernelArrays:
        """The arrays of `actuator`."""
        load = actuator.load
        return cls(actuator.array(), load.breakpoints, load.coefficients, load.combined(), actuator.model)


def start_state(segment: Segment, actuator: Actuator, start: tuple[float, float] | None = None) -> FloatArray:
    """State at the start of `segment`: Eq. (24), or measured position and pressure for a start under pressure.

    The air has the temperature of the walls, the reservoir its full pressure.

    Parameters
    ----------
    start : (m, Pa), optional
        Position and pressure in chamber A, if they have been estimated.
    """
    position, pressure = start if start is not None else (segment.position_start, guessed_pressure(segment, actuator))
    return _begun(actuator.model, actuator.array(), position, pressure)


def start_states(segments: Sequence[Segment], actuators: Sequence[Actuator], parameters: FloatArray) -> FloatArray:
    """`start_state` of several actuators of one model, shape (n, n_states), whose parameters have the shape (n, q)."""
    pressures = np.array(list(map(guessed_pressure, segments, actuators)))
    return _begun(actuators[0].model, parameters, np.array([part.position_start for part in segments]), pressures)


def _begun(
    model: Model, parameters: FloatArray, position: float | FloatArray, pressure: float | FloatArray
) -> FloatArray:
    """States at the start for parameters of shape (..., q), and a position and a pressure of chamber A for each."""
    places, starts_at_parameter, y, p_A = _start_places(model)
    x: FloatArray = parameters.take(places, axis=-1) * starts_at_parameter
    x[..., y], x[..., p_A] = position, pressure
    return x


@lru_cache(maxsize=64)
def _start_places(model: Model) -> tuple[IntArray, NDArray[np.bool_], int, int]:
    """Places of the parameters that states start at, which states start at one (others at 0), places of y and p_A."""
    names, rows = parameter_names(model), state_rows(model)
    places = np.array([names.index(row.starts_at) if row.starts_at else -1 for row in rows.values()])
    return places, places >= 0, [*rows].index("y"), [*rows].index("p_A")


def guessed_pressure(segment: Segment, actuator: Actuator) -> float:
    """Pressure in chamber A at the start: measured, P_0 if vented, else in equilibrium with the load, Eq. (26)."""
    p = actuator.parameters
    if math.isfinite(segment.pressure_start):
        return segment.pressure_start
    if segment.vented:
        return p.P_0
    return p.P_0 + max(0.0, _force(actuator.load, segment.position_start)) / p.A_A


def _force(load: Load, y: float) -> float:
    return float(load.force(np.array([y]))[0])


def run(segment: Segment, arrays: KernelArrays, x0: FloatArray) -> tuple[FloatArray, int]:
    """States at every sample, shape (n, n_states), and the first sample that is not finite, or -1.

    Samples after a failure are NaN.

    Raises
    ------
    ParameterError
        If the segment was planned for a model with other inputs.
    """
    out = np.empty((len(segment), x0.size))
    failed = kernels(arrays.model).run(
        x0.copy(), inputs_of(segment, arrays.model), arrays.parameters, segment.dt, segment.substeps, segment.jump,
        segment.measured, arrays.breakpoints, arrays.load, out,
    )  # fmt: skip
    if failed >= 0:
        out[failed + 1 :] = np.nan
    return out, int(failed)


def run_side_by_side(
    segments: Sequence[Segment], model: Model, tables: tuple[FloatArray, FloatArray, FloatArray], x0: FloatArray,
    out: FloatArray, at: int,
) -> NDArray[np.bool_]:  # fmt: skip
    """`run` of segments with the same numbers of samples, steps and jumps: as many as fill all lanes of some batches.

    Parameters
    ----------
    tables
        Parameters (r, q), breakpoints (b,) and loads (r, s, 4).
    x0 : (r, n_states)
        Start states.
    out : (batches, n_states, n, lanes)
        The states at every sample of each run, (batches, lanes) of them in their order, from sample `at` on.

    Returns
    -------
    failed : (batches, lanes)
        Whether a state is not finite.
    """
    shape, failed = (out.shape[0], out.shape[-1]), np.zeros((out.shape[0], out.shape[-1]), dtype=np.bool_)

    def by_lane(arrays: Sequence[FloatArray] | FloatArray, shape: tuple[int, int] = shape) -> FloatArray:
        values = np.asarray(arrays)
        return np.ascontiguousarray(np.moveaxis(values.reshape(*shape, *values.shape[1:]), 1, -1))

    (p, breakpoints, loads), first = tables, segments[0]
    ends = np.broadcast_to(np.append(breakpoints, np.inf), (len(p), len(breakpoints) + 1))
    # a recording that all have is there once
    recorded = segments[: shape[1]] if len(set(segments)) == 1 else segments
    few = len(recorded) // shape[1], shape[1]
    measured = [segment.measured if first.jump.any() else segment.measured[:1] for segment in recorded]
    lanes(model).run_lanes(
        by_lane(x0), by_lane([inputs_of(segment, model) for segment in recorded], few), by_lane(p),
        by_lane([segment.dt for segment in recorded], few), first.substeps, first.jump, by_lane(measured, few),
        by_lane(ends), by_lane(loads), out, at, failed,
    )  # fmt: skip
    return failed


def run_with_sensitivities(
    segment: Segment,
    arrays: KernelArrays,
    start: tuple[FloatArray, FloatArray],
    which: Columns,
    watched: Sequence[int] | IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """As `run`, with the sensitivities of the states `watched`, and of all states at the end.

    Their shapes are (n, len(watched), n_columns) and (n_states, n_columns). `start` is the state at the start and its
    sensitivities.

    Raises
    ------
    ParameterError
        If the segment was planned for a model with other inputs.
    """
    out = np.empty((len(segment), start[0].size))
    sens = np.empty((len(segment), len(watched), len(which.names)))
    end = start[1].copy()
    failed = kernels(arrays.model).run_all(
        start[0].copy(), end, inputs_of(segment, arrays.model), arrays.parameters, segment.dt,
        segment.substeps, segment.jump, segment.measured, arrays.breakpoints, arrays.load, arrays.basis,
        which.table_basis, which.table_column, which.fill_slot, which.fill_row, which.fill_column,
        np.asarray(watched, dtype=np.int64), out, sens,
    )  # fmt: skip
    if failed >= 0:
        out[failed + 1 :] = np.nan
        sens[failed:] = np.nan
    return out, sens, end, int(failed)


def inputs_of(segment: Segment, model: Model) -> FloatArray:
    """The inputs of `segment`, after a check of their number: the kernels do not check their array bounds.

    Raises
    ------
    ParameterError
        If the segment was planned for a model with other inputs.
    """
    expected: tuple[str, ...] = kernels(model).INPUTS
    if segment.inputs.shape[1] != len(expected):
        raise ParameterError(
            f"a segment with {segment.inputs.shape[1]} inputs cannot be run by the model {model}, which has "
            f"{len(expected)}: {', '.join(expected)}; plan the recording with the same actuator."
        )
    return segment.inputs


def start_sensitivities(segment: Segment, actuator: Actuator, which: Columns, estimated: bool) -> FloatArray:
    """Sensitivities of the start, shape (n_states, n_columns); `estimated` if the start values are free themselves.

    Chambers that start at P_0 depend on it, and a pressure by Eq. (26) depends on the load.
    """
    rows, states = actuator.state_rows, actuator.states
    S = np.zeros((len(states), len(which.names)))
    position, pressure = states.index("y"), states.index("p_A")
    begins = {row.starts_at for row in rows.values()}
    measured = bool(np.isfinite(segment.pressure_start))
    resting = not (segment.vented or estimated or measured)
    y, A_A = segment.position_start, actuator.parameters.A_A
    force = _force(actuator.load, y) if resting else 0.0
    phi = dict(zip(actuator.load.names, actuator.load.phi(np.array([y]))[0], strict=True)) if force > 0.0 else {}
    for column, name in enumerate(which.names):
        if name == POSITION_START:
            S[position, column] = 1.0
        elif name == PRESSURE_START:
            S[pressure, column] = 1.0
        elif name in begins:
            S[:, column] = [float(row.starts_at == name) for row in rows.values()]
            if name == rows["p_A"].starts_at:
                S[pressure, column] = float(resting or (segment.vented and not measured))
        elif force > 0.0:
            S[pressure, column] = -force / A_A**2 if name == "A_A" else phi.get(name, 0.0) / A_A
    return S
