"""The observer and the actuator for machines: C99 for a control unit, FMU, A2L, MATLAB."""
