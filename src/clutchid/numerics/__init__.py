"""Numerical linear algebra and optimisation, independent of the actuator."""
