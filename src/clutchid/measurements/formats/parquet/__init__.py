"""Parquet, one row a sample."""
