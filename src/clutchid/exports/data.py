"""Numbers of a calibration in an exported observer: its data in C."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np

from clutchid.estimation.assess.observed import FLAGGED, TRUSTS, most_trust
from clutchid.exports.filter import FilterSize
from clutchid.inference.filter.joint_filter import JointFilter
from clutchid.inference.filter.setup import LAG, LAG_OF, OFFSET, OFFSET_OF, PARAMETER, WEIGHT
from clutchid.log import FloatArray
from clutchid.log.states import NOISE_SPAN, SENSORS
from clutchid.model.actuator import Actuator
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import FLAGS
from clutchid.observer.following import PRESSURES, UNKNOWN_SHARE
from clutchid.observer.prior import AIR_STD, ASSUMED, BY_FORMULA, KNOWN_AIR_STD, LEAK
from clutchid.observer.state import ObserverState
from clutchid.observer.state_file import fingerprint
from clutchid.simulation.noise import state_deviations
from clutchid.version import installed_version


class Provenance(NamedTuple):
    """Generator of an export with its version, and the hash of its calibration, SHA-256 in hexadecimal digits."""

    version: str
    calibration: str

    @property
    def generator(self) -> str:
        """Generator with its version."""
        return f"clutchid {self.version}"

    @property
    def number(self) -> int:
        """The version as a number, a byte each for its first three parts."""
        parts = [*map(int, re.findall(r"\d+", self.version)[:3]), 0, 0, 0]
        return sum(min(part, 255) << shift for part, shift in zip(parts, (16, 8, 0), strict=False))

    @property
    def head(self) -> str:
        """First line of a header."""
        return f"/* {self.generator}, calibration {self.calibration} */\n"

    def epk(self, name: str) -> str:
        """Identification in the memory of a control unit, at most 79 letters."""
        return f"{name} {self.calibration[:16]} {self.generator}"[:79]


def provenance(observer: Observer) -> Provenance:
    """The generator of an export, and the hash of its calibration."""
    return Provenance(installed_version(), fingerprint(observer))


def size_of(joint: JointFilter) -> FilterSize:
    """Dimensions of a filter in C."""
    actuator, moving, load = joint.mapped.actuator, joint.moving, joint.mapped.actuator.load
    return FilterSize(
        states=len(actuator.states),
        sensors=len(joint.measure),
        parameters=len(joint.coordinates),
        of_model=moving.of_model.size,
        of_sensors=moving.of_sensors.size,
        drifts=joint.drifts.shape[1],
        model_parameters=len(actuator.parameter_names),
        weights=len(load.names),
        pieces=load.breakpoints.size + 1,
        window=moving.window,
        considered=0 if joint.considered is None else joint.considered.start.shape[1],
    )


def data_of(observer: Observer, state: ObserverState) -> dict[str, Any]:
    """Values of the data's template: an observer, and what is known in `state` of the parameters that adapt."""
    joint = observer.joint
    values = _filter_values(joint) | _derived_values(joint) | _start_values(observer)
    values |= _noise_values(observer) | _band_values(observer)
    return values | {
        "theta": state.theta.tolist(),
        "root": _triangle(state.T),
        "prior": _triangle(observer.prior.root),
        "G": state.G[:, 0].tolist() if state.G.size else [],
        "strokes": state.strokes,
        "zero": 2 if state.unzeroed else int(state.jumped),
        "mismatch": state.nis.stored,
        "shift": state.rest_shift,
        "flagged": [FLAGGED.get(flag, (np.inf, np.inf)) for flag in FLAGS],
        "flags": FLAGS,
        "most_trust": TRUSTS.index(most_trust(observer)),
        "pace": dict(zip(("positions", "speeds", "rates"), (part.tolist() for part in joint.pace), strict=True)),
    }


def _triangle(root: FloatArray) -> list[list[float]]:
    return [row[: i + 1].tolist() for i, row in enumerate(root)]


def _filter_values(joint: JointFilter) -> dict[str, Any]:
    free, settings, actuator = joint.free, joint.settings, joint.mapped.actuator
    names = ("mean", "width", "positive", "low", "high", "least", "most")
    parameters = [
        {"name": c.base, **dict(zip(names, numbers, strict=True)), "positive": int(c.positive),
         "weight": place[WEIGHT], "parameter": place[PARAMETER], "lag_of": place[LAG_OF], "offset_of": place[OFFSET_OF]}
        for c, numbers, place in zip(joint.coordinates, free.numbers.tolist(), free.places.tolist(), strict=True)
    ]  # fmt: skip
    adapting = [p["weight"] for p in parameters if p["weight"] >= 0]
    load, lengths = actuator.load, free.pieces[:, 1] - free.pieces[:, 0] + 1
    return {
        "parameters": parameters,
        "sensors": [
            [output, state, row[LAG], row[OFFSET]] for row in joint.sensors.tolist() for output, state in [row[:2]]
        ],
        "reach": np.column_stack([free.pieces, np.append(0, np.cumsum(lengths)[:-1])]).tolist(),
        "breakpoints": load.breakpoints.tolist(),
        "basis": [
            pieces[first : last + 1].ravel().tolist()
            for pieces, (first, last) in zip(load.coefficients, free.pieces.tolist(), strict=True)
        ],
        "first_weight": min(adapting, default=0),
        "drifts": joint.drifts.tolist(),
        "outlier": joint.noise.outlier,
        "least_speed": settings.least_speed,
        "ahead": 0.5 * settings.every * settings.spacing,
        "at_speed": actuator.states.index("v"),
        "at_position": actuator.states.index("y"),
    }


def _derived_values(joint: JointFilter) -> dict[str, Any]:
    actuator, spacing = joint.mapped.actuator, joint.settings.spacing * joint.settings.every
    sensors = [SENSORS[name] for name in joint.measure]
    return {
        "weights": list(actuator.load.theta),
        "load": actuator.load.combined().tolist(),
        "lags": [actuator.value(sensor.lag) for sensor in sensors],
        "offsets": [actuator.value(sensor.offset) for sensor in sensors],
        "sigmas": [joint.noise.of_samples(name, spacing) for name in joint.measure],
        "p": list(zip(actuator.parameter_names, actuator.array().tolist(), strict=True)),
    }


def _start_values(observer: Observer) -> dict[str, Any]:
    actuator, names = observer.joint.mapped.actuator, observer.joint.mapped.actuator.parameter_names
    rows, changed = actuator.state_rows, observer.joint.noise.unknown_start
    unknown = [changed.get(name, row.unknown_start) for name, row in rows.items()]
    return {
        "start": [[row.start for row in rows.values()], unknown],
        "starts_at": [names.index(row.starts_at) if row.starts_at else -1 for row in rows.values()],
        "at_p_A": actuator.states.index("p_A"),
        "at_P_0": names.index("P_0"),
        "at_P_S": names.index("P_S"),
        "at_A_A": names.index("A_A"),
        "at_D_v": names.index("D_v"),
        "at_y_max": names.index("y_max"),
        "y_max": actuator.parameters.y_max,
        "supply_ratio": observer.supply.ratio if observer.supply else 1.0,
        "possible": [PRESSURES[0] * observer.actuator.parameters.P_0, PRESSURES[1] * observer.actuator.parameters.P_S],
    }


def _noise_values(observer: Observer) -> dict[str, Any]:
    joint, spacing = observer.joint, observer.spacing
    actuator, p = joint.mapped.actuator, joint.mapped.actuator.parameters
    second, still, open_ = np.ones(1), np.zeros(1), np.full(1, joint.noise.flow * np.sqrt(NOISE_SPAN))
    noise, at = state_deviations(actuator, joint.noise, second, still)[0], actuator.states.index("p_A")
    both = state_deviations(actuator, joint.noise, second, open_)[0]
    return {
        "noise": noise.tolist(),
        "flow": float(np.sqrt(both[at] ** 2 - noise[at] ** 2)),
        "gap": float(state_deviations(actuator, joint.noise, still, np.full(1, UNKNOWN_SHARE * spacing))[0, at]),
        "opens": [[p.R_0vs, p.R_1vs], [p.R_0ve, p.R_1ve]],
        "considered": [] if joint.considered is None else joint.considered.start[:, 0].tolist(),
        "source": []
        if joint.considered is None
        else (joint.settings.spacing * joint.settings.every * joint.considered.rate[:, 0]).tolist(),
    }


def _band_values(observer: Observer) -> dict[str, Any]:
    p, names = observer.actuator.parameters, [c.base for c in observer.joint.coordinates]
    parameters, powers = observer.joint.mapped.actuator.parameter_names, observer.air.powers if observer.air else {}
    return {
        "usual": observer.usual if observer.compares else 0.0,
        "missed": observer.missed**2,
        "supply_share": observer.supply.share if observer.supply else ASSUMED,
        "by_air": [AIR_STD / p.y_max, KNOWN_AIR_STD / p.y_max],
        "air_powers": [powers.get(name, 0.0) for name in parameters],
        "air_flow": powers.get("C_vs", 0.0) + powers.get("T_0", 0.0),
        "supply_formula": 0.0 if observer.joint.considered else BY_FORMULA * observer.supply_std,
        "ambient_force": p.A_A * p.P_0,
        "leak": names.index(LEAK) if LEAK in names else -1,
    }


def carrier_us(actuator: Actuator) -> int:
    """Period of the valves' carrier in whole microseconds; 0 without one."""
    return round(actuator.parameters.T_pwm * 1e6)
