"""Fits by prediction error: a Kalman filter follows a recording, and what it does not foresee is made small.

At every sample the filter predicts the measurement from all earlier ones. The free numbers are those whose standardised
errors of prediction, and departures from what was known before, have the least sum of squares while the gains of the
filter are held (Ljung 1999, chapter 7; pseudo-linear regression, section 10.4). The filter is the extended Kalman
filter in square-root form (Maybeck 1979, chapter 7; 1982, chapter 9). Its process noise is the model's own inaccuracy
as multiple shooting takes it; so both methods believe the same, and differ in what they do with it: shooting also
estimates every state from the measurements after it, the filter only from those before.
"""
