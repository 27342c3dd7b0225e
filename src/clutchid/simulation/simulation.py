"""`simulate`: the actuator along a recording."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from os import PathLike
from typing import TYPE_CHECKING, Literal

import numpy as np

from clutchid.arguments import checked
from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.names import check_names, listed_names, made_anew
from clutchid.parameters import known_ambient
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.inputs import cut_warnings, input_span, with_inputs
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import Plan, Segment, outside_stroke, plan
from clutchid.simulation.run import (
    Columns,
    KernelArrays,
    columns,
    run,
    run_with_sensitivities,
    start_sensitivities,
    start_state,
)
from clutchid.simulation.stiffness import STABLE_STEP, steepest_slope, stiffness_by_slope, substeps, top_speed
from clutchid.strokes.values import Values, values_of
from clutchid.strokes.vented_pressure import with_ambient

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A simulated recording.

    Attributes
    ----------
    log
        Inputs and all states in SI at the samples of the recording; NaN outside its segments and after a divergence.
    status
        'ok', or 'failed' if the simulation diverged.
    message
        Where and why it diverged; else how it ended.
    warnings
        About the recording and its time steps, one sentence each.
    sensitivities : SI, (n, n_states) each
        For each requested name, derivatives of the states in the order of the model, in units of the state over units
        of the parameter.

    Examples
    --------
    10 kN/m more on the first spline hold the piston back by 0.15 mm after 0.1 s at full supply:

    >>> t = np.arange(0, 0.1, 1e-3)
    >>> pulse = Log(t, {"duty_supply": np.ones(100), "duty_exhaust": np.zeros(100)})
    >>> stroke = simulate(Actuator(), pulse, sensitivities="theta_1")
    >>> f"{1e4 * stroke.sensitivities['theta_1'][-1, 0] * 1e3:.2f} mm"
    '-0.15 mm'
    """

    log: Log
    status: Literal["ok", "failed"]
    message: str
    warnings: tuple[str, ...] = ()
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)

    __reduce__ = made_anew

    def raised(self) -> Simulation:
        """The simulation itself.

        Raises
        ------
        SolveError
            If it diverged.
        """
        if self.status == "failed":
            raise SolveError(self.message)
        return self

    def __repr__(self) -> str:
        sensitivities = f"; sensitivities to {', '.join(self.sensitivities)}" if self.sensitivities else ""
        return f"Simulation({self.status}: {self.message}; {self.log!r}{sensitivities})"

    if TYPE_CHECKING:  # attached by `clutchid.verbs.attached`

        def plot(self) -> Figure: ...


@checked
def simulate(
    actuator: Actuator,
    log: Log | str | PathLike[str],
    *,
    partition: Partition | None = None,
    sensitivities: str | Sequence[str] = (),
    starts: Sequence[tuple[float, float]] | None = None,
    force: bool = False,
    on_failure: Literal["raise", "return"] = "raise",
) -> Simulation:
    """Simulate `actuator` with the inputs of `log`.

    Parameters
    ----------
    actuator : Actuator
        Model variant, parameters and load.
    log : Log or path
        The duty cycles of the valves; the position, if recorded, gives the start and the resets. A file is
        read as by `clutchid.read`, with the actuator's P_0 added to gauge pressures.
    partition : Partition, optional
        Re-initialise the position; without it the simulation is ballistic.
    sensitivities : names
        Parameters and load weights, also as one text with commas; 'load' means all load weights. Their sensitivities
        are the exact derivatives of the discretised system, not of the differential equation (docs/derivations.md).
    starts : (m, Pa) per segment, optional
        Position and pressure in chamber A at the start of each segment, if a fit has estimated them.
    force : bool
        Continue even if the measured position is impossible for this piston, for example because it is in mm.
    on_failure : 'raise' or 'return'
        What to do if the simulation diverges.

    Returns
    -------
    simulation : Simulation
        NaN outside the segments and after a divergence.

    Raises
    ------
    DataError
        If the recording lacks an input or no sample has both, a column has another unit, or a partition is given
        without a recorded position.
    ParameterError
        For an unknown name in `sensitivities` or a wrong number of `starts`.
    SolveError
        If the simulation diverges and `on_failure` is 'raise'; the text names time, state, term and parameters.

    Examples
    --------
    The supply valve, fully open, drives the piston 20 mm in 0.15 s:

    >>> t = np.arange(0, 0.3, 1e-3)
    >>> stroke = simulate(Actuator(), Log(t, {"duty_supply": np.ones(300), "duty_exhaust": np.zeros(300)}))
    >>> f"{t[np.argmax(stroke.log['position'] > 0.02)]:.2f} s"
    '0.15 s'
    """
    log = log if isinstance(log, Log) else read_log(log, actuator)
    prepared = prepared_log(actuator, log, partition, force=force)
    actuator = prepared.fitted(actuator)
    rate = stiffness_by_slope(actuator, steepest_slope(actuator.load), top_speed(partition))
    segments = prepared.stepped(rate)
    if starts is not None and len(starts) != len(segments):
        raise ParameterError(f"starts: {len(starts)} given, the recording has {len(segments)} segments.")
    places = [None] * len(segments) if starts is None else starts
    x0 = [start_state(segment, actuator, place) for segment, place in zip(segments, places, strict=True)]
    arrays = KernelArrays.of(actuator)
    if names := _known(sensitivities, actuator) if len(sensitivities) else ():
        which = columns(actuator, names)
        S = [start_sensitivities(segment, actuator, which, starts is not None) for segment in segments]
        by_name = np.full((len(prepared.values.log), len(actuator.states), len(which.names)), np.nan)
        states, message = states_of(prepared, actuator, segments, arrays, x0, (which, S, by_name[prepared.span]))
        result = simulation_of(prepared, actuator, states, message)
        result = replace(result, sensitivities={name: by_name[:, :, c] for c, name in enumerate(which.names)})
    else:
        result = simulation_of(prepared, actuator, *states_of(prepared, actuator, segments, arrays, x0))
    return result.raised() if on_failure == "raise" else result


#: Parameters that the preparation of a recording depends on, beside model, equipment, and what its values hold for.
PREPARED_BY = ("P_0", "R_0vs", "R_1vs", "R_0ve", "R_1ve", "T_pwm", "s_pwm", "y_max")

_PREPARED_BY = attrgetter(*PREPARED_BY)

#: Preparations that a recording keeps, and samples of the longest recording that keeps any: an hour's takes 200 MB.
_KEPT, _LONGEST = 64, 200_000


@dataclass(frozen=True, slots=True, eq=False)
class PreparedLog:
    """A recording that is ready to be simulated, with one integration step an interval.

    What counts as a value, the span of its inputs, the plan, notes on the ambient pressure, all warnings, why it is
    refused unless with force, the longest interval between samples in s, and what the plans of recordings that can be
    simulated side by side have in common.
    """

    values: Values
    span: slice
    plan: Plan
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    refusal: str
    longest: float
    form: Hashable

    def fitted(self, actuator: Actuator) -> Actuator:
        """An actuator with the ambient pressure that the recording has."""
        return actuator.replace({"P_0": self.plan.actuator.parameters.P_0}) if self.notes else actuator

    def stepped(self, rate: float) -> tuple[Segment, ...]:
        """The segments with integration steps for a stiffness in 1/s.

        Raises
        ------
        ParameterError
            If it is too stiff for the recording.
        """
        segments = self.plan.segments
        if self.longest * rate <= STABLE_STEP:
            return segments
        return tuple(replace(segment, substeps=substeps(segment.dt, rate)) for segment in segments)


def prepared_log(actuator: Actuator, log: Log, partition: Partition | None, *, force: bool = False) -> PreparedLog:
    """Prepare a recording for an actuator; the recording keeps it for all that are alike in what it depends on.

    Raises
    ------
    DataError
        As `simulate`.
    """
    key = PreparedLog, actuator.model, actuator.equipment, partition, _PREPARED_BY(actuator.parameters)
    prepared = log.derived.get(key)
    if not isinstance(prepared, PreparedLog) or not prepared.values.hold_for(actuator):
        prepared = _prepared(actuator, log, partition)
        if len(log) <= _LONGEST:
            log.derived[key] = prepared
        if len(log.derived) > _KEPT:
            log.derived.pop(next(iter(log.derived)), None)
    if prepared.refusal and not force:
        raise DataError(prepared.refusal)
    return prepared


def _prepared(actuator: Actuator, log: Log, partition: Partition | None) -> PreparedLog:
    values = values_of(actuator.equipment.driven(log), actuator)
    actuator, notes = with_ambient(actuator, [values.log])
    span = input_span(values.log)
    planned = plan(with_inputs(values.log, span), actuator, 0.0, partition)
    warnings = (*notes, *values.warnings, *cut_warnings(values.log, span), *planned.warnings)
    longest = max(float(segment.dt.max(initial=0.0)) for segment in planned.segments)
    form = len(values.log), span.start, *((s.start, s.stop, s.jump.tobytes()) for s in planned.segments)
    sentences, alien = outside_stroke(planned.log, actuator.parameters.y_max)
    refusal = f"{sentences[0]}\nCorrect the recording, or go on with force=True." if alien else ""
    return PreparedLog(values, span, planned, notes, warnings, refusal, longest, form)


def states_of(
    prepared: PreparedLog,
    actuator: Actuator,
    segments: Sequence[Segment],
    arrays: KernelArrays,
    starts: Sequence[FloatArray],
    sensitivities: tuple[Columns, Sequence[FloatArray], FloatArray] | None = None,
) -> tuple[FloatArray, str]:
    """States at all samples of a recording, (n, n_states), and why they diverged, if they did.

    Parameters
    ----------
    starts : (n_states,) each
        States at the start of each segment.
    sensitivities
        Columns, their values at the start of each segment, and the array (samples of the span, n_states, n_columns)
        that they are written to.
    """
    names, message = actuator.states, ""
    everywhere = np.full((len(prepared.values.log), len(names)), np.nan)
    states = everywhere[prepared.span]
    for number, segment in enumerate(segments):
        at = slice(segment.start, segment.stop)
        if sensitivities is None:
            states[at], failed = run(segment, arrays, starts[number])
        else:
            which, S, sens = sensitivities
            start = starts[number], S[number]
            states[at], sens[at], _, failed = run_with_sensitivities(segment, arrays, start, which, range(len(names)))
        if failed >= 0 and not message:
            message = failure_message(prepared.plan.log, segment, states[at], failed, names, actuator)
    return everywhere, message


def simulation_of(prepared: PreparedLog, actuator: Actuator, states: FloatArray, message: str) -> Simulation:
    """The result of states at all samples of a recording; `message` says why it diverged, if it did."""
    log = simulated_log(prepared.values.log, states, actuator)
    return Simulation(log, "failed" if message else "ok", message or "simulated to the end", prepared.warnings)


def _known(names: str | Sequence[str], actuator: Actuator) -> tuple[str, ...]:
    expanded = actuator.expanded(listed_names(names))
    check_names(expanded, actuator.names)
    return expanded


def read_log(path: str | PathLike[str], actuator: Actuator) -> Log:
    """A recording from its file, with a measured P_0 added to gauge pressures."""
    from clutchid.measurements import read

    return read(path, added=known_ambient(actuator.parameters.P_0), required=("time", *actuator.equipment.recorded))


def simulated_log(log: Log, states: FloatArray, actuator: Actuator) -> Log:
    """A log of the simulated states of the `actuator` and of the inputs of a recording."""
    simulated = {row.column: states[:, i] for i, row in enumerate(actuator.state_rows.values())}
    inputs = {name: log[name] for name in INPUTS}
    return Log(log.time, {"position": simulated.pop("position"), **inputs, **simulated}, log.name, log.metadata)
