"""Arrays that the recursion of the filter works on, in SI.

The filter has n states of the model and one output per sensor; size = n + sensors. S has k columns for free parameters
and, where gains are computed, size columns for the square root of the covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray

IntArray = NDArray[np.int64]

#: Arguments of the generated `step` after state, inputs and interval: parameters, load (breakpoints, coefficients,
#: basis), which columns of S are load weights (basis, column) and parameters (slot, row, column), and its work array.
ModelArrays = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray, IntArray, IntArray, IntArray, FloatArray
]

#: What is given for each interval: inputs (samples, inputs), of which the last row is not used; length in s, steps of
#: integration (samples - 1,); standard deviation of the process noise (samples - 1, n); lags of the sensors
#: (samples - 1, sensors, 6), see `clutchid.simulation.sensors.lag_coefficients`.
Intervals = tuple[FloatArray, FloatArray, NDArray[np.int32], FloatArray, FloatArray]

#: What is given of the measurements: values (samples, sensors), NaN for none; offset and standard deviation of each
#: sensor (sensors, 2); standard deviations beyond which an innovation is an outlier.
Measurements = tuple[FloatArray, FloatArray, float]

#: Scratch arrays: measured states before a step with their rows of S (sensors, 1 + columns); ``[L | Q]``, with Q the
#: square root of the process noise (size, size + n), or (0, 0) with given gains; a row of S (columns,).
Scratch = tuple[FloatArray, FloatArray, FloatArray]

#: What `follow` writes: rows (samples, sensors, k + 1), see `write_row`; innovations and their variances (samples,
#: sensors, 2), NaN for none; states of the model after each sample (samples, n); derivatives of one state and its
#: standard deviation (samples, k + 1).
FilterOutput = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
