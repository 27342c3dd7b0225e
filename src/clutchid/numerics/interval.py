"""The 95 % interval, as every result has it."""

#: Half width of a 95 % interval in standard deviations.
QUANTILE = 1.96
