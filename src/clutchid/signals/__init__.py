"""What sampled signals show: runs, velocity, excitation, and the colour of residuals."""
