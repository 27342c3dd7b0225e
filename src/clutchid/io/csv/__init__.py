"""CSV as it comes from everywhere."""
