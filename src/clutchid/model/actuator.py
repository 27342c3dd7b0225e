"""`Actuator`: a model, parameters and a load."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.log.states import SENSOR_PARAMETERS, State
from clutchid.model.compiled import Model, check_model, kernels, parameter_names, state_names, state_rows
from clutchid.model.equipment import Equipment
from clutchid.model.own import OwnModel, OwnParameter
from clutchid.model.weighted_load import Load, in_metres
from clutchid.names import check_names, unknown_name
from clutchid.parameters import DEFAULTS, Parameters, Row


@dataclass(frozen=True)
class Actuator:
    """An actuator: model, parameters and load, and which chambers and valves there are.

    The parameters of a missing chamber or valve have the values that represent its absence.

    Parameters
    ----------
    parameters : SI
        Values of the built-in parameters; by default Appendix A.
    load : N over m
        The load on the piston; by default theta = (9e5, 0, 0) N/m on the paper's splines.
    model
        A variant by name, or an `OwnModel`.
    equipment
        Chambers and valves that exist; by default those of the paper.
    own : SI
        Values of the parameters of an `OwnModel`, in its order; by default its defaults.
    duty_period : s
        Period at which the control unit renews the duty cycles, as a calibration at 1 kHz shows it; 0 if they change
        continuously. By default that of the valves' carrier, `T_pwm`.

    Raises
    ------
    ParameterError
        If there is no such variant, values of own parameters are missing or outside their range, or the knots of the
        load lie far beyond the stroke.

    Examples
    --------
    >>> Actuator().value("C_vs")
    1.9e-08
    """

    parameters: Parameters = field(default_factory=Parameters)
    load: Load = field(default_factory=Load)
    model: Model = "isothermal"
    equipment: Equipment = field(default_factory=Equipment)
    own: tuple[float, ...] = ()
    duty_period: float | None = None

    def __post_init__(self) -> None:
        check_model(self.model)
        if self.duty_period is not None and not 0.0 <= self.duty_period < np.inf:
            raise ParameterError(f"duty_period = {self.duty_period} s: a period is at least 0 s and finite.")
        if meant := in_metres(self.load.knots, self.parameters.y_max):
            raise ParameterError(
                f"knots = {self.load.knots} m: far beyond the stroke, y_max = {self.parameters.y_max:g} m.{meant}"
            )
        object.__setattr__(self, "parameters", self.equipment.fitted(self.parameters))
        rows = self._own_rows
        values = tuple(map(float, self.own)) or tuple(float(row.default) for row in rows.values())
        if len(values) != len(rows):
            raise ParameterError(
                f"own = {self.own}: the model {self.model} has {len(rows)} parameters of its own: "
                f"{', '.join(rows) or 'none'}."
            )
        problems = [
            f"{name} = {value:g}{'' if row.unit == '1' else ' ' + row.unit}: it must be {row.row.allowed}. The "
            f"default is {row.default:g}."
            for (name, row), value in zip(rows.items(), values, strict=True)
            if not row.row.admits(value)
        ]
        ParameterError.raise_for(problems)
        object.__setattr__(self, "own", values)

    def __repr__(self) -> str:
        usual = Actuator(model=self.model, equipment=self.equipment)
        defaults = {
            "parameters": usual.parameters, "load": usual.load, "model": "isothermal", "equipment": Equipment(),
            "own": usual.own, "duty_period": None,
        }  # fmt: skip
        changed = [f"{name}={value!r}" for name, d in defaults.items() if (value := getattr(self, name)) != d]
        return f"Actuator({', '.join(changed)})"

    @property
    def _own_rows(self) -> Mapping[str, OwnParameter]:
        return self.model.parameters if isinstance(self.model, OwnModel) else {}

    @property
    def names(self) -> tuple[str, ...]:
        """All names that `value` and `replace` know: the parameters, then the load weights."""
        return (*self.parameter_names, *self.load.names)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of `array`."""
        return parameter_names(self.model)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the model's states, in the order of its kernels."""
        return state_names(self.model)

    @property
    def state_rows(self) -> Mapping[str, State]:
        """The rows of the model's states by name, in the order of its kernels."""
        return state_rows(self.model)

    @property
    def in_equations(self) -> frozenset[str]:
        """Names of the parameters that the model's equations hold."""
        names = self.parameter_names
        return frozenset(names[q] for _, q in kernels(self.model).SLOTS)

    @property
    def acting(self) -> frozenset[str]:
        """Names of the parameters that have an effect: in the equations or a sensor's, as the valves are driven."""
        rows, valves = self.rows, "switched" if self.parameters.T_pwm > 0.0 else "averaged"
        names = {*self.in_equations, *SENSOR_PARAMETERS}
        return frozenset(name for name in names if rows[name].valves in ("", valves))

    def array(self) -> FloatArray:
        """Values of the parameters in the order of `parameter_names`, shape (n_parameters,)."""
        return np.append(self.parameters.array(), self.own) if self.own else self.parameters.array()

    @property
    def rows(self) -> Mapping[str, Row]:
        """The rows of all parameters by name, in the order of `array`."""
        own = self._own_rows
        return {**Parameters.rows(), **{name: entry.row for name, entry in own.items()}} if own else Parameters.rows()

    def row(self, name: str) -> Row:
        """Unit, meaning, admissible range and source of a parameter.

        Raises
        ------
        ParameterError
            If there is no such parameter; the text names the nearest known one.
        """
        rows = self.rows
        check_names([name], rows)
        return rows[name]

    def own_row(self, name: str) -> OwnParameter | None:
        """The row of a parameter of an `OwnModel`; None for any other name."""
        return self._own_rows.get(name)

    def default(self, name: str) -> float:
        """The default of a parameter."""
        own = self.own_row(name)
        return getattr(DEFAULTS, name) if own is None else float(own.default)

    def value(self, name: str) -> float:
        """Value of a parameter or load weight, in SI.

        Raises
        ------
        ParameterError
            For an unknown name; the text has the nearest known one.
        """
        if name in self.load.names:
            return self.load.theta[self.load.names.index(name)]
        if name in self._own_rows:
            return self.own[list(self._own_rows).index(name)]
        if name not in Parameters.names():
            raise ParameterError(unknown_name(name, self.names))
        result: float = getattr(self.parameters, name)
        return result

    def expanded(self, names: Iterable[str]) -> tuple[str, ...]:
        """`names` with all load weights in place of 'load'."""
        return tuple(name for item in names for name in (self.load.names if item == "load" else (item,)))

    def unit(self, name: str) -> str:
        """Unit of a parameter or load weight."""
        return self.load.unit if name in self.load.names else self.row(name).unit

    def unit_behind(self, name: str) -> str:
        """Unit of a parameter or load weight as it stands behind its value, with a space; empty where it has none."""
        unit = self.unit(name)
        return "" if unit == "1" else f" {unit}"

    def replace(self, changes: Mapping[str, float] | None = None, /, **by_name: float) -> Actuator:
        """A copy with other parameter values or load weights, checked again.

        ``replace({"P_S": 7e5, "theta_1": 8e5})`` or ``replace(P_S=7e5, theta_1=8e5)``.

        Raises
        ------
        ParameterError
            For an unknown name, a value outside its range, or a chamber or valve that does not exist.
        """
        changes = {**(changes or {}), **by_name}
        theta = tuple(changes.get(name, value) for name, value in zip(self.load.names, self.load.theta, strict=True))
        others = {name: value for name, value in changes.items() if name not in self.load.names}
        problems = [unknown_name(name, self.names) for name in others if name not in self.parameter_names]
        problems += [sentence for name in others if (sentence := self.equipment.missing(name))]
        ParameterError.raise_for(problems)
        rows = self._own_rows
        own = tuple(others.pop(name, value) for name, value in zip(rows, self.own, strict=True))
        load = self.load if theta == self.load.theta else replace(self.load, theta=theta)  # it keeps its table
        return replace(self, parameters=self.parameters.replace(others), load=load, own=own)
