"""The paper's model, one file a section, models of one's own, and what is compiled from them."""

from clutchid.model.actuator import Actuator
from clutchid.model.own import OwnModel, OwnParameter, OwnState
from clutchid.model.own.file import own_model
from clutchid.model.weighted_load import PAPER_KNOTS, Load
from clutchid.parameters import GroupChange

__all__ = ["PAPER_KNOTS", "Actuator", "GroupChange", "Load", "OwnModel", "OwnParameter", "OwnState", "own_model"]
