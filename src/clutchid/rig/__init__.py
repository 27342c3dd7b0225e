"""Friction from a test rig: LuGre from position and force, Coulomb friction at each constant pressure."""

from clutchid.rig.coulomb import CoulombFriction, FrictionLevel, coulomb_friction
from clutchid.rig.lugre import LugreFit, fit_lugre
from clutchid.rig.summary import conclusions, implied
from clutchid.rig.weighted import Equality

__all__ = [
    "CoulombFriction",
    "Equality",
    "FrictionLevel",
    "LugreFit",
    "conclusions",
    "coulomb_friction",
    "fit_lugre",
    "implied",
]
