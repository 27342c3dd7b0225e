"""Fits by multiple shooting with soft continuity: search, result, checks; see `clutchid.inference.smoother`."""
