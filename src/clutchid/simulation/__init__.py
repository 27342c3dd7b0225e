"""Simulation of an actuator with the inputs of a recording, and exact derivatives of the discretised system."""

from clutchid.simulation.many import Simulations, simulate_many
from clutchid.simulation.partition import Partition
from clutchid.simulation.simulation import Simulation, simulate

__all__ = ["Partition", "Simulation", "Simulations", "simulate", "simulate_many"]
