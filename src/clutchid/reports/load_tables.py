"""Tables of load curves: the load over the position."""

from __future__ import annotations

import numpy as np

from clutchid.estimation import LoadCurve
from clutchid.reports.style import MM
from clutchid.reports.tables import Cell, Column, Table

#: Step of the positions in a table of the load in m.
STEP = 1e-3


def load_table(curve: LoadCurve, reach: float) -> Table:
    """The load and its band on a grid of positions up to the reach in m."""
    columns = (
        Column("position [m]", "position [mm]", MM, 0), Column("force [N]", "load [N]", 1.0, 0),
        Column("low [N]", "from [N]", 1.0, 0, group="95 % band"),
        Column("high [N]", "to [N]", 1.0, 0, group="95 % band"),
    )  # fmt: skip
    last = min(reach, float(curve.position[-1])) if np.isfinite(reach) else 0.0
    rows: list[tuple[Cell, ...]] = []
    for position in np.arange(0.0, last + 1e-9, STEP):
        values = (np.interp(position, curve.position, y) for y in (curve.force, curve.low, curve.high))
        rows.append((float(position), *(float(value) for value in values)))
    return Table("Load over position", columns, tuple(rows), note="Up to the reach of the recordings.")
