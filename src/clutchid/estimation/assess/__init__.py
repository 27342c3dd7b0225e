"""Assessment of a result: residuals, verdict with reasons, and missing excitation."""
