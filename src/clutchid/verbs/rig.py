"""`friction`: friction of a seal from recordings of a test rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Literal

from clutchid.arguments import checked
from clutchid.measurements import AMBIENT
from clutchid.verbs.reading import LogOrPath, Reading, reading_of

if TYPE_CHECKING:
    from clutchid.documents import RigFriction
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.rig import CoulombFriction, LugreFit


@checked
def friction(
    logs: LogOrPath | Sequence[LogOrPath],
    *,
    law: Literal["coulomb", "lugre"] = "coulomb",
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    area: float | None = None,
    fixed: Mapping[str, float] | None = None,
    inertia: float = 0.0,
) -> CoulombFriction | list[LugreFit]:
    """Friction of a seal from recordings of a test rig, with position, force and, where measured, pressure.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with the columns position and force.
    law : 'coulomb' or 'lugre'
        Coulomb friction at each constant pressure, see `clutchid.rig.coulomb_friction`; or F_C, K_z, D_v and D_zdot of
        each recording, see `clutchid.rig.fit_lugre`.
    ambient : Pa, optional
        Ambient pressure, by default 101,300 Pa.
    channels
        Channel map of the files, as in `clutchid.read`.
    area : m², optional
        Slope of the force over the pressure, if known; for 'coulomb'.
    fixed : {name: value}, optional
        Parameters that are not estimated, in SI; for 'lugre'.
    inertia : kg
        Mass between the load cell and the friction; for 'lugre'.

    Returns
    -------
    friction : CoulombFriction or list of LugreFit
        By `law`; of LuGre one for each recording.

    Raises
    ------
    DataError, ParameterError
        If a recording lacks a column or has no usable strokes.

    Examples
    --------
    A seal that brakes with 5 N each way:

    >>> import clutchid
    >>> import numpy as np
    >>> t = np.arange(0.0, 40.0, 0.01)
    >>> y, way = 0.04 * np.abs((t / 4 + 1) % 2 - 1), np.where(t % 8.0 < 4.0, 1.0, -1.0)
    >>> friction = clutchid.friction(clutchid.Log(t, {"position": y, "force": 5.0 * way}))
    >>> f"{friction.levels[0].friction.value:.1f} N"
    '5.0 N'
    """
    reading = reading_of(logs)
    reading = replace(reading, ambient=ambient, channels=channels) if reading.files else reading
    return rig_friction(reading, ambient, law, area, fixed or {}, inertia).friction


def rig_friction(
    reading: Reading,
    ambient: float | None,
    law: Literal["coulomb", "lugre"],
    area: float | None,
    fixed: Mapping[str, float],
    inertia: float,
) -> RigFriction:
    """`friction` of recordings that are read first, with these recordings.

    Raises
    ------
    DataError, ParameterError
        As `friction`; the text lists the problems of all files.
    """
    from clutchid.documents import RigFriction
    from clutchid.rig import coulomb_friction, fit_lugre

    logs = reading.read(required=("time", "position", "force"))
    if law == "lugre":
        return RigFriction(logs, [fit_lugre(log, fixed=fixed, inertia=inertia) for log in logs])
    return RigFriction(logs, coulomb_friction(logs, ambient=AMBIENT if ambient is None else ambient, area=area))
