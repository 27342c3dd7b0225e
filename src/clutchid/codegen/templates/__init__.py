"""Texts around the printed equations, filled by Jinja."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment, Template


def template(name: str, package: str = "clutchid.codegen") -> Template:
    """The template in the file `name` of the folder ``templates`` of `package`.

    Raises
    ------
    jinja2.TemplateNotFound
        If there is no such file.
    """
    return _environment(package).get_template(name)


@cache
def _environment(package: str) -> Environment:
    """The environment of a package, which keeps the templates that it has compiled."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader(package),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
