"""Analysis of sampled signals: runs, velocity, excitation, and autocorrelation of residuals."""
