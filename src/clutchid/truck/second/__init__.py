"""Family B of the virtual trucks: another plant than family A in every part where an honest one can differ.

Spool or solenoid valves with a nozzle's flow, duty cycles latched by the period or continuous, polytropic air in two
zones, Maxwell slip or elasto-plastic bristles, a cubic or tabulated clutch with play, a pressure regulator, sensors
with a curved scale and coloured noise. Driving, manoeuvres, controller, recorder, return spring and stops are shared.
"""

from clutchid.truck.second.arrays import SECOND
from clutchid.truck.second.parameters import TruckB

__all__ = ["SECOND", "TruckB"]
