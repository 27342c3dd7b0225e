"""MATLAB files, v4 to v7.3."""
