"""Results with the further facts that their documents need."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clutchid.documents.fleet_tables import ReasonCount, VehicleRow
    from clutchid.estimation import LoadCurve
    from clutchid.inference.uncertainty.calibration import Origin
    from clutchid.log import Log
    from clutchid.observer import ObservedRecording
    from clutchid.rig import CoulombFriction, LugreFit
    from clutchid.wear import Wear


class Observation(NamedTuple):
    """An observed recording, and the calibration that the observer started from."""

    run: ObservedRecording
    origin: Origin


class WornClutch(NamedTuple):
    """The wear of a clutch, with the loads of the recordings that count, by name and in order.

    `left_out` says what was not read as a recording, `home` is the page of the fleet relative to its own.
    """

    wear: Wear
    curves: Sequence[tuple[str, LoadCurve]]
    left_out: str = ""
    home: str = ""


class FleetWear(NamedTuple):
    """The vehicles of a fleet, and why recordings do not count."""

    vehicles: Sequence[VehicleRow]
    reasons: Sequence[ReasonCount]


class RigFriction(NamedTuple):
    """Friction in recordings of a rig: by Coulomb's law, or by the LuGre law, a fit a recording."""

    logs: Sequence[Log]
    friction: CoulombFriction | list[LugreFit]
