"""Preparation of a recording for an actuator: carrier, pulses, time grid and integration steps."""
