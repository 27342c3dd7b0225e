"""Links from a page to a file beside it."""

from __future__ import annotations

import os
from typing import NamedTuple
from urllib.parse import quote


class Link(NamedTuple):
    """A text that leads to a file, with its path relative to the page; without a path, only the text."""

    text: str
    path: str = ""

    @property
    def address(self) -> str:
        """The path as a relative address, percent-encoded: it can neither name a server nor run anything.

        Examples
        --------
        >>> Link("", "vehicles/50 % #1.html").address, Link("", "javascript:alert(1)").address
        ('vehicles/50%20%25%20%231.html', 'javascript%3Aalert%281%29')
        >>> Link("", "//server/page.html").address
        './server/page.html'
        """
        address = quote(os.fsencode(self.path))
        return f"./{address.lstrip('/')}" if address.startswith("/") else address
