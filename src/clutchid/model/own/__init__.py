"""Physics of one's own on top of a model variant: records, checks, equations, files."""

from clutchid.model.own.model import OwnModel
from clutchid.model.own.rows import OwnParameter, OwnState

__all__ = ["OwnModel", "OwnParameter", "OwnState"]
