"""Result files of Modelica tools (Dymola, OpenModelica): matrices whose channels have their names in another matrix."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.measurements.formats.mat import loaded
from clutchid.measurements.formats.mat.loaded import Node, NumberArray, Struct

_MATRICES = {"Aclass", "name", "dataInfo"}
_UNIT = re.compile(r"\[([^\[\]|]*)(?:\|[^\[\]]*)?\]\s*$")


def contents(path: Path) -> Struct:
    """The variables of the file, as `loaded.contents`; of a result file its channels under their names."""
    root = loaded.contents(path)
    if not root.fields.keys() >= _MATRICES:
        return root
    wanted = [name for name in root.fields if name in (*_MATRICES, "description") or name.startswith("data_")]
    channels = _channels(loaded.load(path, wanted))
    return Struct(channels) if channels else root


def _channels(values: Mapping[str, Any]) -> dict[str, Node] | None:
    """The channels of a result file by name, with the units of their descriptions; None where it is none.

    Constants, which are in a matrix of two samples, are left out.
    """
    transposed = "binTrans" in "".join(_rows(values["Aclass"]))
    names = _texts(values["name"], transposed)
    about = _texts(values["description"], transposed) if "description" in values else [""] * len(names)
    info = np.asarray(values["dataInfo"]).T if transposed else np.asarray(values["dataInfo"])
    if len(names) != len(info):
        return None
    sizes = {number: _matrix(values, number, transposed).shape[0] for number in np.unique(info[:, 0]) if number > 0}
    longest = max(sizes, key=lambda number: sizes[number], default=0)
    channels: dict[str, Node] = {}
    for name, text, (number, place, *_) in zip(names, about, info.tolist(), strict=True):
        used = longest if number == 0 else number  # 0 is the time of all
        matrix = _matrix(values, used, transposed)
        if used == longest and 0 < abs(place) <= matrix.shape[1]:
            unit = _UNIT.search(text)
            samples = np.sign(place) * matrix[:, abs(place) - 1 : abs(place)]
            channels[name] = NumberArray(samples.shape, samples, unit[1].strip() if unit else None)
    return channels


def _matrix(values: Mapping[str, Any], number: int, transposed: bool) -> Any:
    """The samples of the matrix with this number, a column a channel."""
    matrix = np.atleast_2d(np.asarray(values.get(f"data_{number}", np.empty((0, 0))), dtype=np.float64))
    return matrix.T if transposed else matrix


def _rows(texts: Any) -> list[str]:
    return [str(text) for text in np.ravel(texts)]


def _texts(texts: Any, transposed: bool) -> list[str]:
    """The texts of a matrix of characters: its rows, or its columns, which some writers store one after the other."""
    rows = _rows(texts)
    if not transposed:
        return [row.strip() for row in rows]
    width = max(map(len, rows), default=0)
    padded = [row.ljust(width) for row in rows]
    columns = ["".join(column).strip() for column in zip(*padded, strict=True)]
    if columns and re.fullmatch(r"time|(simulation )?time( in)?.*", columns[0].casefold()):
        return columns  # the first name or description is that of the time
    text, size = "".join(padded), len(rows)
    return [text[i : i + size].strip() for i in range(0, len(text), size)]
