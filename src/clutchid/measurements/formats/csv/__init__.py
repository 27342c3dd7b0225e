"""CSV files in the dialects of common tools."""
