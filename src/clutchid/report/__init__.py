"""Figures, tables and self-contained pages; light to import, matplotlib and jinja2 are loaded where they are used."""

from clutchid.report.fit_page import fit_page
from clutchid.report.tables import Column, Table

__all__ = ["Column", "Table", "fit_page"]
