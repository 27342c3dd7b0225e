"""Strokes and rests: cut a long recording, and choose the most informative strokes.

>>> import numpy as np
>>> from clutchid.log import Log
>>> from clutchid.strokes import choose, joined, sections_of
>>> t = np.arange(0.0, 9.0, 1e-3)
>>> y = np.interp(t, [2.0, 2.1, 3.0, 3.3, 6.0, 6.1, 7.0, 7.3], [0.0, 0.02, 0.02, 0.0] * 2)
>>> chosen = choose(sections_of(Log(t, {"position": y})), seconds=2.0)
>>> [section.kind for section in chosen], len(joined(chosen))
(['stroke'], 1800)
"""

from clutchid.strokes.choice import choose
from clutchid.strokes.cutting import sections_of
from clutchid.strokes.section import Section, SectionSummary, joined

__all__ = ["Section", "SectionSummary", "choose", "joined", "sections_of"]
