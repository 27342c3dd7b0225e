"""Every result as one `Document`, and its renderers; matplotlib and jinja2 are imported on demand."""

from clutchid.documents.document import Document, LabelRow, On
from clutchid.documents.html import write_page
from clutchid.documents.results import FleetWear, Observation, RigFriction, WornClutch, document_of
from clutchid.documents.tables import Column, ReportTable, to_csv
from clutchid.documents.terminal import lines_of

__all__ = [
    "Column",
    "Document",
    "FleetWear",
    "LabelRow",
    "Observation",
    "On",
    "ReportTable",
    "RigFriction",
    "WornClutch",
    "document_of",
    "lines_of",
    "to_csv",
    "write_page",
]
