"""Figures, tables and self-contained pages; matplotlib and jinja2 are imported on demand."""

from clutchid.documents.fit_page import fit_page
from clutchid.documents.tables import Column, ReportTable

__all__ = ["Column", "ReportTable", "fit_page"]
