"""Texts around the printed equations, filled by Jinja."""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def template(name: str, package: str = "clutchid.codegen") -> Any:
    """The template in the file `name` of the folder ``templates`` of `package`.

    Raises
    ------
    jinja2.TemplateNotFound
        If there is no such file.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(package),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(name)
