"""Fits by simulation error, the paper's method: ballistic or partitioned."""
