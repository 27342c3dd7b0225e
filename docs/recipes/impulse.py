"""Write a container of Impulse's silver tables as a recording: python impulse.py SILVER CONTAINER V1/run.parquet

`channels` has values that hold over [tstart, tend) in ns, by container_id and channel_id; `channel_tags` has the names
of channels (key channel_name), and `container_metrics` the start of the container.
"""

import sys
from pathlib import Path

import numpy as np
import polars as pl

import clutchid

#: Channels by the columns of clutchid, and the factors that give their SI units.
COLUMNS = {"position": ("ClutchPos", 1e-3), "duty_supply": ("DutySupply", 0.01), "duty_exhaust": ("DutyExhaust", 0.01)}

#: Sample interval in s.
STEP = 1e-3


def recording(silver: Path, container: int) -> clutchid.Log:
    """The channels of a container on one time grid; each value holds until the next."""
    own = pl.col("container_id") == container
    tags, channels, metrics = (pl.scan_parquet(silver / f"{name}.parquet").filter(own).collect()
                               for name in ("channel_tags", "channels", "container_metrics"))  # fmt: skip
    names = dict(tags.filter(key="channel_name").select("value", "channel_id").rows())
    first, last = channels["tstart"].min(), channels["tend"].max()
    time = np.arange(0.0, (last - first) * 1e-9, STEP)
    columns = {}
    for column, (name, factor) in COLUMNS.items():
        values = channels.filter(channel_id=names[name]).sort("tstart")
        at = np.searchsorted((values["tstart"].to_numpy() - first) * 1e-9, time + 1e-9, side="right") - 1
        columns[column] = np.where(at >= 0, factor * values["value"].to_numpy()[at], np.nan)
    return clutchid.Log(time, columns, metadata={"start": metrics["start_ts"][0].isoformat()})


if __name__ == "__main__":
    clutchid.write(recording(Path(sys.argv[1]), int(sys.argv[2])), sys.argv[3])
