"""On line: the load, the pressure and their bands from position and duty cycles, sample by sample."""
