"""A recording made ready for an actuator: carrier, pulses, time grid and integration steps."""
