"""Whether a result can be trusted, why, and what a recording lacks."""
