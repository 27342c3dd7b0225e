"""Simulation of an actuator along a recording: ballistic or partitioned, with exact sensitivities."""

from clutchid.simulate.partition import Partition
from clutchid.simulate.simulation import Simulation, simulate

__all__ = ["Partition", "Simulation", "simulate"]
