"""Read recordings as events name them, as a task of Airflow or a function of a queue does: once a row, whatever comes.

python events.py s3://bucket/fleet/V1/a.mf4 s3://bucket/fleet/V2/b.mf4
"""

import sys

import clutchid

CALIBRATIONS, WEAR = "calibrations", "wear"


def read_event(address: str) -> str:
    """Read one recording and append its row; with Airflow, `@task` above it, and `read_event.expand(address=[...])`."""
    row = clutchid.fleet_once(address, CALIBRATIONS, WEAR, verb="track")
    return f"{row['vehicle']}, {row['recording']}: {row['status']}"


if __name__ == "__main__":
    for address in sys.argv[1:]:
        print(read_event(address))
