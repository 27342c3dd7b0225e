"""Estimation by prediction error, with an extended Kalman filter.

The filter predicts each sample from all earlier ones. The estimate minimises the sum of squares of the standardised
prediction errors and of the deviations from the priors, with the gains of the filter fixed in each round (Ljung 1999,
chapter 7; pseudo-linear regression, section 10.4). The filter is in square-root form (Maybeck 1979, chapter 7; 1982,
chapter 9). Its process noise is that of multiple shooting, so that both methods make the same assumptions; multiple
shooting is a smoother, which estimates each state from all measurements.
"""
