"""Options as people write them, on the command line and on the page: `RequestText` of a fit, `ReadingText` of files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from clutchid.errors import ParameterError
from clutchid.log.units import UNITS, known_units
from clutchid.names import listed_names

if TYPE_CHECKING:
    from clutchid.estimation.request import FitRequest
    from clutchid.inference.uncertainty.coordinates import Prior
    from clutchid.model.compiled import Model
    from clutchid.simulation.partition import Partition
    from clutchid.verbs.reading import LogOrPath, Reading


#: Measured columns and free parameters where a request names none, by verb.
USUAL: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "fit": (("position",), ("load",)),
    "calibrate": (("position", "pressure_a"), ("auto",)),
    "estimate": (("position",), ("load",)),
}


def requested(verb: str, request: FitRequest | None, **everyday: Any) -> FitRequest:
    """The request of a verb: its own columns and parameters, unless the request or an everyday option names others.

    Raises
    ------
    ParameterError
        If an everyday option contradicts the request.
    """
    from clutchid.estimation.request import FitRequest

    usual = FitRequest()
    asked = request or usual
    stated = {name: value for name, value in everyday.items() if value is not None}
    for name in stated.keys() & {"free", "measure"}:
        stated[name] = listed_names(stated[name])
    for name, value in stated.items():
        own = getattr(asked, name)
        if own not in (getattr(usual, name), value):
            raise ParameterError(
                f"{name} = {value!r}: the request has {name} = {own!r}; give one of them, or the same value twice."
            )
    return (replace(asked, **stated) if stated else asked).completed(*USUAL[verb])


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestText:
    """Options of a fit as text, in the command line's words; the fields are those of `FitRequest`.

    Parameters
    ----------
    measure
        Measured columns to compare: position, or position,pressure_a, as `calibrate` does by default; pressure_a alone
        with the position as input.
    free
        Free parameters, comma-separated. `load` (the default) means all load weights; `auto` (the default of
        `calibrate`) means all parameters that a recording with pressure can determine; `NAME@EACH` means one parameter
        per recording, reported as NAME@STEM.
    bounds
        Bounds in SI units, NAME=LOW:HIGH. Give one or several; a side may be empty.
    every
        Restart the simulation at the measured position after every N samples.
    parts
        Restart the simulation at the measured position at the start of N equal parts.
    carry
        At a restart, keep the pressures (p, the paper and the default) or the masses of air (q).
    take
        Restart at all measured columns (the default), or at the position alone. With `--every 1 --carry q --take
        position` the measured position is an input, and only the air is simulated.
    model
        Model variant: isothermal (the paper), energy-balance, either with -stribeck; or FILE.py:NAME, a model of your
        own (the file is executed). By default isothermal; for `--free auto` energy-balance-stribeck, without a carrier
        energy-balance-stribeck-proportional.
    method
        simulation, shooting or prediction-error. simulation is the method of the paper, shooting is multiple shooting
        with soft continuity, prediction-error is a Kalman filter that predicts every sample. The default is the method
        of the calibration in --start; without one, shooting if the request needs it, as a calibration does, else
        simulation.
    prior
        Priors NAME=VALUE±STD in SI units (or NAME=VALUE+-STD), STD a standard deviation; one or several.
    profile
        Free parameters whose intervals come from profile likelihood, comma-separated; with shooting only, seconds each.
    bootstrap
        Number of draws, for example 200, of a bootstrap over strokes that checks the band of the load; 0 for none;
        with shooting only.
    zero
        With a calibration in --start: subtract the shift of the vented rest since the calibration, caused by wear or
        a new sensor, or keep the recorded position.
    """

    measure: str | None = None
    free: str | None = None
    bounds: list[str] | None = None
    every: int | None = None
    parts: int | None = None
    carry: Literal["p", "q"] | None = None
    take: Literal["all", "position"] | None = None
    model: str | None = None
    method: Literal["simulation", "shooting", "prediction-error"] | None = None
    prior: list[str] | None = None
    profile: str | None = None
    bootstrap: int = 0
    zero: Literal["subtract", "keep"] = "subtract"

    def request(self, verb: str) -> FitRequest:
        """The request of a verb with these options.

        Raises
        ------
        ParameterError
            If an option cannot be understood.
        """
        from clutchid.estimation.request import FitRequest

        request = FitRequest(
            bounds=bounds(self.bounds or ()),
            partition=partition_of(self.every, self.parts, self.carry, self.take),
            method=self.method,
            priors=priors(self.prior or ()),
            profile=listed_names(self.profile or ""),
            bootstrap=self.bootstrap,
            zero=self.zero,
        )
        return requested(verb, request, measure=self.measure, free=self.free)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingText:
    """Options of how recordings are read, as text.

    Parameters
    ----------
    ambient
        Ambient pressure, for example 1.013bar. It is the pressure of the vented chamber in a calibration, and the
        zero of gauge units. For gauge units the default is P_0 of the parameter file if it was measured, else 1.013bar.
    map
        Channel map (TOML) of the recordings. `clutchid look --save` writes it.
    dbc
        DBC files that decode bus logs; one or several.
    """

    ambient: str | None = None
    map: Path | None = None
    dbc: list[Path] | None = None

    def reading(
        self,
        logs: Iterable[LogOrPath],
        verify: Iterable[LogOrPath] = (),
        *,
        force: bool = False,
        zero: Literal["subtract", "keep"] = "subtract",
    ) -> Reading:
        """Recordings that are read with these options.

        Raises
        ------
        ParameterError
            If the ambient pressure cannot be understood.
        """
        from clutchid.verbs.reading import Reading

        ambient, dbc = pressure_option(self.ambient), tuple(self.dbc or ())
        return Reading(tuple(logs), tuple(verify), ambient, self.map, dbc, force, zero)


#: The options where none is given.
USUAL_SEARCH, USUAL_FILES = RequestText(), ReadingText()


def words_of(options: RequestText | ReadingText) -> list[str]:
    """Options that differ from their defaults, as arguments of a command.

    Examples
    --------
    >>> words_of(RequestText(free="load,P_S", bounds=["P_S=8e5:"]))
    ['--free', 'load,P_S', '--bounds', 'P_S=8e5:']
    """
    words: list[str] = []
    for option in fields(options):
        value = getattr(options, option.name)
        if value in (option.default, [], ""):
            continue
        texts = [str(item) for item in value] if isinstance(value, list) else [str(value)]
        words += [f"--{option.name}", *texts]
    return words


def model_of(text: str | None) -> Model | None:
    """The option --model: a variant, or FILE.py:NAME of a model of one's own, whose file is executed."""
    from clutchid.model.own.file import model_named

    return None if text is None else model_named(text)


def partition_of(
    every: int | None,
    parts: int | None,
    carry: Literal["p", "q"] | None,
    take: Literal["all", "position"] | None = None,
) -> Partition | None:
    """The options --every, --parts, --carry and --take; None is ballistic."""
    from clutchid.simulation.partition import Partition

    if every is None and parts is None:
        for option, value in (("carry", carry), ("take", take)):
            if value is not None:
                raise ParameterError(f"--{option} {value}: there are no resets; give --every N or --parts N.")
        return None
    return Partition(every=every, parts=parts, carry=carry or "p", take=take or "all")


def pressure_option(text: str | None) -> float | None:
    """A pressure option in Pa: a number in Pa, or with a unit; None where it is not given."""
    if text is None:
        return None
    number, unit = text.strip(), "Pa"
    for name in sorted(known_units("Pa"), key=len, reverse=True):
        if number.endswith(name):
            number, unit = number.removesuffix(name).strip(), name
            break
    try:
        value = float(number) * UNITS[unit].scale
    except ValueError:
        value = math.nan
    if UNITS[unit].gauge or not (1e4 < value < 2e5):
        raise ParameterError(
            f"--ambient {text}: an absolute pressure between 0.1 and 2 bar is needed, for example 1.013bar or 101300."
        )
    return value


def bounds(items: Sequence[str]) -> dict[str, tuple[float, float]]:
    """``NAME=LOW:HIGH`` options; an empty side is open."""
    result: dict[str, tuple[float, float]] = {}
    for item in items:
        match = re.fullmatch(r"\s*(\w+)\s*=([^:]*):([^:]*)", item)
        try:
            name, low, high = match.groups() if match else ("", "x", "x")
            result[name] = (float(low or "-inf"), float(high or "inf"))
        except ValueError:
            raise ParameterError(
                f"--bounds {item}: write NAME=LOW:HIGH in SI units, for example C_vs=1e-8:3e-8; a side may be empty."
            ) from None
    return result


def priors(items: Sequence[str]) -> dict[str, Prior]:
    """``NAME=VALUE±STD`` options."""
    from clutchid.inference.uncertainty.coordinates import Prior

    result = {}
    for item in items:
        match = re.fullmatch(r"\s*([^=\s]+)\s*=\s*(.+?)\s*(?:±|\+-|\+/-)\s*(.+?)\s*", item)
        try:
            name, mean, std = match.groups() if match else ("", "x", "x")
            result[name] = Prior(float(mean), float(std))
        except ValueError:  # of `float` or `Prior`
            raise ParameterError(
                f"--prior {item}: write NAME=VALUE±STD in SI units, STD a standard deviation above 0, "
                "for example P_S=8.5e5±5e3."
            ) from None
    return result


def life_limit(limit: float | None) -> float | None:
    """A shift option ``--limit`` in m: what ends the life of a clutch."""
    from clutchid.wear.tables import MOST_MM

    if limit is None:
        return None
    if not 0.0 < abs(limit) <= MOST_MM:
        raise ParameterError(
            f"--limit {limit:g}: a shift in mm is needed, not 0 and at most {MOST_MM:g}; for example 0.7, or below 0 "
            "if the half-load position falls."
        )
    return limit * 1e-3
