"""Wear of a clutch over its life: measurements, their order, a trend with alarms, and what is left.

Every recording is a measurement of two numbers, each against the calibration: the shift of the position of half load,
and the relative change of the load where the clutch engages. A trend over strokes (or distance, or time) follows them.
"""

from clutchid.wear.alarms import Alarm
from clutchid.wear.history import Axis
from clutchid.wear.life import Wear
from clutchid.wear.trend import FALSE_ALARMS, LIFE, Interval

__all__ = ["FALSE_ALARMS", "LIFE", "Alarm", "Axis", "Interval", "Wear"]
