"""Colours of figures and of the local page: readers with any sight can tell the curves of one figure apart."""

import re
from dataclasses import asdict
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import clutchid.app
from clutchid.documents.style import STYLE

#: Linear sRGB as it is seen without each kind of cones (Machado, Oliveira and Fernandes, 2009, severity 1).
SIGHT = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}

#: Linear sRGB to cones, and their cube roots to lightness and two hues (OKLab, Ottosson, 2020).
CONES = [
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
]
LAB = [
    [0.2104542553, 0.7936177850, -0.0040720468],
    [1.9779984951, -2.4285922050, 0.4505937099],
    [0.0259040371, 0.7827717662, -0.8086757660],
]

#: Smallest distance in OKLab: about five differences that are just noticeable, 0.02.
APART = 0.095

CURVES = ("ink", "measured", "blue", "orange", "green", "red", "purple")
SHEET = (Path(clutchid.app.__file__).parent / "static" / "style.css").read_text(encoding="utf-8")


def themes():
    """The colours of each theme of the local page, by name."""
    blocks = re.findall(r"\{([^{}]*--ink:[^{}]*)\}", SHEET)
    return [dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block)) for block in blocks]


def chosen(colours):
    return {name: colours[name] for name in CURVES}


def lab(colour, sight):
    values = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return LAB @ np.cbrt(CONES @ np.clip(SIGHT[sight] @ linear, 0.0, 1.0))


PALETTES = {
    "figures": chosen(asdict(STYLE)),
    "the paper's figures": {
        **{name: getattr(STYLE, name) for name in ("ink", "measured", "orange")},
        **{f"N = {2 ** (i + 1)}": colour for i, colour in enumerate(STYLE.ordered)},
    },
    **{f"page, theme {i}": chosen(colours) for i, colours in enumerate(themes())},
}


@pytest.mark.parametrize("palette", PALETTES)
def test_any_two_colours_of_a_palette_are_apart_for_every_sight(palette):
    colours = PALETTES[palette]
    close = {
        (first, other, sight): round(float(distance), 3)
        for first, other in combinations(colours, 2)
        for sight in SIGHT
        if (distance := np.linalg.norm(lab(colours[first], sight) - lab(colours[other], sight))) < APART
    }
    assert close == {}


def test_an_increasing_parameter_goes_from_dark_to_light():
    lightness = [lab(colour, "normal")[0] for colour in STYLE.ordered]
    assert lightness == sorted(lightness)


def test_the_light_page_has_the_colours_of_the_figures():
    assert len(themes()) >= 2
    assert chosen(themes()[0]) == PALETTES["figures"]
