"""The virtual truck: recordings from a more detailed plant than the paper's model, with separate truth.

>>> from clutchid.truck import drive, truck
>>> done = drive(truck(7), seconds=5, seed=1, wear=1e-3)
>>> done.log.columns.keys() >= {"position", "duty_supply", "duty_exhaust", "pressure_a"}
True
"""

from clutchid.truck.assembly import load_curve
from clutchid.truck.changes import CHANGES, aged, changed
from clutchid.truck.driving import Drive, drive, respond
from clutchid.truck.families import RANGES, truck
from clutchid.truck.kinds import Truck, TruckB
from clutchid.truck.manoeuvres import MANOEUVRES
from clutchid.truck.truth import GRID, Truth, write_truth
from clutchid.truck.vehicle import Vehicle

__all__ = [
    "CHANGES", "GRID", "MANOEUVRES", "RANGES", "Drive", "Truck", "TruckB", "Truth", "Vehicle", "aged", "changed",
    "drive", "load_curve", "respond", "truck", "write_truth",
]  # fmt: skip
