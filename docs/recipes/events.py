"""Read recordings as events name them, as a task of Airflow or a function of a queue does: once a row, whatever comes.

python events.py s3://bucket/fleet/V1/a.mf4 s3://bucket/fleet/V2/b.mf4
"""

import sys

import clutchid

FLEET, CALIBRATIONS, WEAR = "fleet", "calibrations", "wear"


def read_event(address: str) -> str:
    """Read one recording and append its row; with Airflow, `@task` above it, and `read_event.expand(address=[...])`."""
    try:
        row = clutchid.fleet_once(address, CALIBRATIONS, WEAR, source=FLEET, verb="track")
    except clutchid.ClutchidError as error:  # such as no calibration: the next event goes on
        return str(error)
    return f"{row['vehicle']}, {row['recording']}: {row['status']}"


if __name__ == "__main__":
    for address in sys.argv[1:]:
        print(read_event(address))
