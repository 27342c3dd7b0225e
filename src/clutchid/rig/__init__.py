"""Friction from a test rig: LuGre from position and force, Coulomb friction at each held pressure."""

from clutchid.rig.coulomb import CoulombFriction, Level, coulomb_friction
from clutchid.rig.lugre import LugreFit, fit_lugre
from clutchid.rig.weighted import Equality
from clutchid.rig.words import implied, verdict

__all__ = ["CoulombFriction", "Equality", "Level", "LugreFit", "coulomb_friction", "fit_lugre", "implied", "verdict"]
