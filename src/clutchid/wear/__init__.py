"""Wear of a clutch over its life: measurements, their order, a trend with alarms, and what is left.

Every recording is a measurement of two numbers, each against the calibration: the shift of the position of half load,
and the relative change of the load where the clutch engages. A trend over strokes (or distance, or time) follows them.
"""
