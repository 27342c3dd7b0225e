"""The extended Kalman filter along a recording, in square-root form."""
