"""Foundations of the estimates: priors and noise, the Kalman filter, windows and links of shooting."""
