"""MDF 2 to 4: channel groups are rasters."""
