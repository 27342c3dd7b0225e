"""The paper's model, one file a section, and what is compiled from it."""

from clutchid.model.actuator import PAPER_KNOTS, Actuator, Load

__all__ = ["PAPER_KNOTS", "Actuator", "Load"]
