"""Arrays that the recursions work on, in SI.

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

#: Columns of `numbers`, one row a free parameter: mean, width, whether it is positive, bounds in SI, bounds of theta;
#: see `clutchid.inference.uncertainty.coordinates.Coordinate`.
MEAN, WIDTH, POSITIVE, LOW, HIGH, LEAST, MOST = range(7)

#: Columns of `places`, one row a free parameter, -1 for none: its load weight, its place among the parameters, the
#: sensor whose lag it is, the sensor whose offset it is.
WEIGHT, PARAMETER, LAG_OF, OFFSET_OF = range(4)

#: What is fixed about the free parameters: `numbers` (k, 7), `places` (k, 4), and the first and last piece of each load
#: weight's basis function (weights, 2).
FreeArrays = tuple[FloatArray, IntArray, IntArray]

#: What follows from theta: load weights (weights,), lag of each sensor (sensors,), offset and standard deviation of
#: each sensor (sensors, 2), derivatives of the free parameters in SI with respect to theta (k,).
Derived = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

#: State of the filter: x (size,), S = [D | L] (size, k + size), theta (k,), T (k, k), see `joint`; the process noise
#: since the last correction (n + sensors,): variances of the states, and the share of a measured state's noise in its
#: sensor's output; and 1 while a stroke lasts (1,).
StateArrays = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray]

#: Scratch arrays: those of `Scratch`; gain of x and variance of the innovation (size + 1,); two vectors
#: (k,); a matrix (k, k + d) for the drift of the parameters.
JointScratch = tuple[Scratch, FloatArray, FloatArray, FloatArray, FloatArray]

#: Settings of the recursion: samples between corrections; standard deviations beyond which an innovation is an outlier;
#: speed in m/s above which parameters adapt; rows of speed and position in x.
SettingsArrays = tuple[int, float, float, tuple[int, int]]

#: What `follow_jointly` writes: innovations and their variances (samples, sensors, 2), NaN for none; the states of the
#: model after each sample (samples, n), and their standard deviations (samples, n), NaN between corrections.
JointOutput = tuple[FloatArray, FloatArray, FloatArray]
