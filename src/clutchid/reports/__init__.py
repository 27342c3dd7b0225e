"""Figures, tables and self-contained pages; matplotlib and jinja2 are imported on demand."""

from clutchid.reports.fit_page import fit_page
from clutchid.reports.tables import Column, Table

__all__ = ["Column", "Table", "fit_page"]
