"""Every result as one `Document`, and its renderers; matplotlib and jinja2 are imported on demand."""

from clutchid.documents.document import Document, LabelRow, On
from clutchid.documents.html import write_page
from clutchid.documents.results import FleetWear, Observation, RigFriction, WornClutch, document_of

__all__ = [
    "Document",
    "FleetWear",
    "LabelRow",
    "Observation",
    "On",
    "RigFriction",
    "WornClutch",
    "document_of",
    "write_page",
]
