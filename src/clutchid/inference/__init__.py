"""What estimates rest on: priors and noise, the Kalman filter along a recording, windows and links of shooting."""
