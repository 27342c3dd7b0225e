"""Fits by multiple shooting with soft continuity: search, result, checks; the smoother is `clutchid.smoother`."""
