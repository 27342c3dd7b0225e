"""Checks of a recording before any fit, all told at once: `inspect`, one file a check.

>>> import numpy as np
>>> from clutchid.inspection import inspect
>>> from clutchid.log import Log
>>> still = Log(np.arange(200) / 100, {"position": np.zeros(200)})
>>> inspect(still).findings[0].value
'100 Hz'
"""

from clutchid.inspection.finding import Finding, Inspection, Verdict
from clutchid.inspection.recording import inspect

__all__ = ["Finding", "Inspection", "Verdict", "inspect"]
