"""Generated texts for the wheel, so that a first start neither imports SymPy nor derives the equations again."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Texts(BuildHookInterface):
    """The texts of the standard models, made from the sources and put beside the module that finds them.

    An editable install gets none: its sources change, and its cache keeps what is made of them.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the texts."""
        if version == "editable":
            return
        sys.path.insert(0, str(Path(self.root) / "src"))
        from clutchid.codegen.cache import TEXTS
        from clutchid.model.compiled import write_texts

        self.folder = tempfile.TemporaryDirectory()
        for path in write_texts(Path(self.folder.name)):
            build_data["force_include"][str(path)] = f"clutchid/codegen/{TEXTS.name}/{path.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Take the files away that the wheel now holds."""
        if version != "editable":
            self.folder.cleanup()
