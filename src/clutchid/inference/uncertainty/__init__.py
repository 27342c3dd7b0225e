"""Priors, noise, identifiability, and uncertainty of estimates."""
