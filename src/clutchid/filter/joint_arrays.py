"""Arrays that the joint recursion of states, load weights and parameters works on, besides those of `arrays`."""

from __future__ import annotations

from clutchid.filter.arrays import IntArray, Scratch
from clutchid.log import FloatArray

#: Columns of `numbers`, one row a free parameter: mean, width, whether it is positive, bounds in SI, bounds of theta;
#: see `clutchid.uncertainty.coordinates.Coordinate`.
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

#: Scratch arrays: those of `arrays.Scratch`; gain of x and variance of the innovation (size + 1,); two vectors
#: (k,); a matrix (k, k + d) for the drift of the parameters.
JointScratch = tuple[Scratch, FloatArray, FloatArray, FloatArray, FloatArray]

#: Settings of the recursion: samples between corrections; standard deviations beyond which an innovation is an outlier;
#: speed in m/s above which parameters adapt; rows of speed and position in x.
SettingsArrays = tuple[int, float, float, tuple[int, int]]

#: Positions in m and speeds in m/s that separate ranges, and the integration steps a second in each; see `pace`.
Pace = tuple[FloatArray, FloatArray, FloatArray]

#: What `follow_jointly` writes: innovations and their variances (samples, sensors, 2), NaN for none; the states of the
#: model after each sample (samples, n), and their standard deviations (samples, n), NaN between corrections.
JointOutput = tuple[FloatArray, FloatArray, FloatArray]
