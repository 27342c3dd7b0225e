"""Checks of a recording before any fit, reported together: `inspect`, one module per subject.

>>> import numpy as np
>>> from clutchid.preparation.inspection import inspect
>>> from clutchid.log import Log
>>> still = Log(np.arange(200) / 100, {"position": np.zeros(200)})
>>> inspect(still).checks[0].value
'100 Hz'
"""

from clutchid.preparation.inspection.reading import Check, Grade, Inspection
from clutchid.preparation.inspection.recording import inspect

__all__ = ["Check", "Grade", "Inspection", "inspect"]
