"""A pressure sensor with a zero error: ``python benchmarks/pressure_zero.py --trucks A0,B0,h:1-0 --folder FOLDER``.

Every truck is calibrated with a pressure whose sensor shows so many mbar too much, in an absolute column and in a gauge
one, with and without ``--ambient``; its worn clutch is read with each calibration from position alone. Printed is, for
each, the trust, the mean error of the load over 5 to 8 mm in % of the peak, the share of the points from 0.5 to 20 mm
in the 95 % band, and what the result says of the sensor. ``--altitude 0.8`` drives the trucks at that pressure in bar.

A result is a line of ``--folder``/results.jsonl as soon as it is there, and not made again.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from vented import STROKES, WEAR, errors

from clutchid import FitRequest, fit
from clutchid.errors import ClutchidError
from clutchid.log import Log
from clutchid.measurements.checks import AMBIENT
from clutchid.measurements.source import UNIT_KEY, VENTED_KEY
from clutchid.truck import GRID, Vehicle, drive, truck

SECONDS = 20.0

#: Zero errors in mbar.
ZEROS = (-50, -20, 0, 20, 70, 85, 150, 300)

#: Forms of the column: whether it is gauge, and whether ``--ambient`` is given.
FORMS = {
    "absolute": (False, False),
    "gauge": (True, False),
    "absolute, --ambient": (False, True),
    "gauge, --ambient": (True, True),
}


def as_read(log: Log, kind: Vehicle, zero: float, form: str) -> Log:
    """`log` as it is read from a file in a form, with a zero error in Pa."""
    gauge, stated = FORMS[form]
    added = kind.P_0 if stated else AMBIENT
    metadata = {"ambient_Pa": repr(added)} | ({VENTED_KEY: repr(added)} if stated else {})
    metadata |= {UNIT_KEY: "bar(g)"} if gauge else {}
    shift = zero + (added - kind.P_0 if gauge else 0.0)
    return replace(log.with_columns(pressure_a=log["pressure_a"] + shift), metadata=metadata)


def result(name: str, zero: int, form: str, altitude: float | None) -> dict[str, Any]:
    """Errors of a calibration and of a reading with it."""
    family, number = name.rsplit("-", 1) if "-" in name else (name[0], name[1:])
    kind = truck(int(number), family)
    kind = kind if altitude is None else kind.replace({"P_0": altitude * 1e5})
    new = drive(kind, seconds=SECONDS, seed=1, name="calibration")
    worn = drive(kind, seconds=SECONDS, seed=2, wear=WEAR, cycles=WEAR * STROKES, pressure=False, name="worn")
    row: dict[str, Any] = {"truck": name, "zero": zero, "form": form, "altitude": altitude}
    log = as_read(new.log, kind, 100.0 * zero, form)
    try:
        once = fit(log, measure=("position", "pressure_a"), free=("auto",))
        row["calibration"] = errors(once, new.truth.load(GRID))
        said = (*once.notes, *once.warnings, *once.verdict.reasons)
        row["says"] = [text for text in said if "settle" in text]
        row["reasons"] = [*once.verdict.reasons]
        row["P_0"] = once.actuator.parameters.P_0
        row["force"] = once.load_curve.force.tolist()
        reading = fit(worn.log, once.actuator, request=FitRequest(calibration=once.calibration))
        row["reading"] = errors(reading, worn.truth.load(GRID))
    except ClutchidError as error:
        row["failed"] = str(error)
    return row


def cell(errors_of: dict[str, Any]) -> str:
    """A load in a table."""
    return f"{errors_of['error']:+.2f} | {errors_of['covered']:.0f} | {errors_of['width']:.1f} | {errors_of['trust']}"


def line(row: dict[str, Any]) -> str:
    """A row of the table."""
    begin = f"| {row['truck']} | {row['form']} | {row['zero']:+d} |"
    if "reading" not in row:
        return f"{begin} {row['failed']} |"
    return f"{begin} {row['P_0'] * 1e-5:.3f} | {cell(row['calibration'])} | {cell(row['reading'])} | {row['says']} |"


def main() -> None:
    """Make what is missing, and print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", default="A0,B0,h:1-0", help="such as A0,B12,h:7-3")
    options.add_argument("--zeros", default=",".join(map(str, ZEROS)), help="in mbar")
    options.add_argument("--forms", default=";".join(FORMS))
    options.add_argument("--altitude", type=float, help="ambient pressure in bar")
    options.add_argument("--folder", type=Path, default=Path("pressure_zero"))
    chosen = options.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    path = chosen.folder / "results.jsonl"
    rows = [json.loads(text) for text in path.read_text("utf-8").splitlines()] if path.exists() else []
    there = {(row["truck"], row["zero"], row["form"], row["altitude"]): row for row in rows}
    for name in chosen.trucks.split(","):
        for form in chosen.forms.split(";"):
            for zero in map(int, chosen.zeros.split(",")):
                row = there.get((name, zero, form, chosen.altitude))
                if row is None:
                    row = result(name, zero, form, chosen.altitude)
                    with path.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
                print(line(row), flush=True)


if __name__ == "__main__":
    main()
