"""Numerical linear algebra and optimisation that know no actuator."""
