"""A document in a notebook: its rows, wrapped, with its figure."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from html import escape
from typing import TYPE_CHECKING

from clutchid.documents.figures import svg
from clutchid.documents.html import answer_html
from clutchid.documents.style import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from clutchid.documents.document import Document


def notebook_html(document: Document) -> str:
    """The document as a notebook shows it, with the figure as an element of its own."""
    figure = notebook_figure(document)
    picture = "" if figure is None else svg(figure)
    rows = answer_html(replace(document, figure=None))
    return f'<div style="max-width: {STYLE.width:g}in"><strong>{escape(document.title)}</strong>{rows}{picture}</div>'


def notebook_figure(document: Document) -> Figure | None:
    """The figure of a document, which a notebook shows as SVG although pyplot does not know it; None without one."""
    if document.figure is None:
        return None
    figure = document.figure().figure
    assert not isinstance(figure, bytes)
    figure._repr_svg_ = partial(svg, figure)  # type: ignore[attr-defined]
    return figure
