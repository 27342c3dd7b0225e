"""Identify channels by name: English, German and J1939 words of the quantities, and units at the end."""

from __future__ import annotations

import re
import tomllib
from enum import IntEnum
from functools import cache
from pathlib import Path

from clutchid.measurements.columns import quantity_named

_FILE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


@cache
def _words(text: str) -> frozenset[str]:
    """The words of a text, in which one in capitals stands for those of a group of the file."""
    return frozenset[str]().union(*(_words(_FILE["groups"][w]) if w.isupper() else {w} for w in text.split()))


_TEXTS = [
    *_FILE["groups"].values(),
    *(text for row in _FILE["quantities"].values() for text in (*row["needs"], row["likes"], row["never"])),
]

#: Words that German compounds consist of, the longest first.
_KNOWN = dict.fromkeys(
    sorted({word for text in _TEXTS for word in _words(text) if len(word) > 2}, key=lambda word: (-len(word), word))
)

#: Symbols that may stand directly before a word: ``pcyl``, ``usup``.
_SYMBOLS = tuple("puxy")

_JOINTS = ("", "s", "es", "n", "en", "e", "er")

_UMLAUTS = str.maketrans({"ü": "ue", "ä": "ae", "ö": "oe", "ß": "ss", "Ü": "Ue", "Ä": "Ae", "Ö": "Oe"})


class Circuit(IntEnum):
    """Source of the air of a pressure, the nearest to a clutch actuator last."""

    BRAKES = 0
    SUPPLY = 1
    AUXILIARIES = 2
    POWERTRAIN = 3


def name_score(name: str, text: str) -> float:
    """Score of a channel text for the quantity `name`: 0 for no match, 100 if it is the name itself.

    Examples
    --------
    >>> name_score("position", "Kupplungsweg"), name_score("position", "Weg"), name_score("position", "ThrottlePos")
    (2.0, 1.0, 0.0)
    """
    standard = quantity_named(_bare(text)) or quantity_named(_bare(text).rpartition(".")[2])  # a field of a struct
    if standard is not None:
        return 100.0 if standard == name else 0.0
    quantity = _FILE["quantities"].get(name)
    if quantity is None:
        return 0.0
    words = set(_tokens(text))
    if words & _words(quantity["never"]) or not all(words & _words(group) for group in quantity["needs"]):
        return 0.0
    circuit = _circuit(words) if name == "pressure_supply" else Circuit.BRAKES
    if circuit is None or (name == "pressure_a" and words & _words("AIR") and not words & _words("CLUTCH CHAMBER")):
        return 0.0
    return 1.0 + len(words & _words(quantity["likes"])) + 10.0 * circuit


def circuit_of(text: str) -> Circuit | None:
    """The circuit of a supply pressure that is called `text`; None if it supplies no clutch actuator.

    Examples
    --------
    >>> [circuit_of(text) for text in ("Vorratsdruck", "Kreisdruck 4", "Bremskreis 1 Druck", "Kreisdruck 3")]
    [<Circuit.SUPPLY: 1>, <Circuit.AUXILIARIES: 2>, <Circuit.BRAKES: 0>, None]
    """
    return _circuit(set(_tokens(text)))


def _circuit(words: set[str]) -> Circuit | None:
    numbers = words if words & _words("NUMBERED") else set[str]()
    if words & _words("CLUTCH") and not words & _words("TANK"):  # the pressure in the chamber
        return None
    if words & _words("POWERTRAIN"):
        return Circuit.POWERTRAIN
    if words & _words("AUXILIARIES") or numbers & _words("FOURTH_CIRCUIT"):
        return Circuit.AUXILIARIES
    if words & _words("BRAKES") or numbers & _words("FIRST_CIRCUITS"):
        return Circuit.BRAKES
    return None if numbers & _words("THIRD_CIRCUIT") else Circuit.SUPPLY


def is_set_point(text: str) -> bool:
    """Whether a channel is called like what a controller asks for, not like what is measured.

    Examples
    --------
    >>> [is_set_point(text) for text in ("Kupplungsweg_Soll", "Sollposition", "ClutchPosCmd", "Kupplungsweg_Ist")]
    [True, True, True, False]
    """
    return not _words("SET_POINT").isdisjoint(_tokens(text))


def is_beside(text: str) -> bool:
    """Whether a channel is called like what a valve has beside its duty cycle: a flag, a status, a current.

    Examples
    --------
    >>> [is_beside(text) for text in ("MV_Be_aktiv", "PWM_Supply_valid", "Ventilstrom_Be", "TV_Belueften")]
    [True, True, True, False]
    """
    return not _words("BESIDE").isdisjoint(_tokens(text))


def is_named_by_j1939(text: str) -> bool:
    """Whether an air pressure has the name of the standard, in the spelling of the databases of buses.

    Examples
    --------
    >>> [is_named_by_j1939(text) for text in ("AuxEquipmentSupplyPress", "AIR1_PneumaticSupplyPressure", "pSupply")]
    [True, True, False]
    """
    words = set(_tokens(text))
    return any(words.issuperset(name.split()) for name in _FILE["standard_names"])


def means_time(text: str) -> bool:
    """Whether a channel is called like a time."""
    return name_score("time", text) > 0.0


def means_no_time(text: str) -> bool:
    """Whether a channel is called like another quantity; single letters such as x are not enough.

    Examples
    --------
    >>> [means_no_time(text) for text in ("position(:,1)", "t", "x(:,1)", "curve", "Kolbenweg")]
    [True, False, False, False, True]
    """
    long = " ".join(token for token in _tokens(text) if len(token) > 1)
    return not means_time(text) and any(name_score(name, long) > 0.0 for name in _FILE["quantities"] if name != "time")


def _bare(text: str) -> str:
    return text.partition("[")[0]


def _tokens(text: str) -> list[str]:
    """Words of a channel name in lower case, split at CamelCase, underscores, and in German compounds of known words.

    >>> _tokens("KupplungsWeg_ist"), _tokens("ClutchPos"), _tokens("Entlüftungsventil")
    (['kupplung', 'weg', 'ist'], ['clutch', 'pos'], ['entlueftung', 'ventil'])
    """
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", _bare(text).translate(_UMLAUTS))
    return [token for part in parts for token in _compound(part.casefold())]


def _compound(word: str) -> list[str]:
    """Split a compound of known words and German joining letters; any other word is returned unchanged."""
    if word[:1] in _SYMBOLS and word not in _KNOWN and word[1:] in _KNOWN:
        return [word[0], word[1:]]
    if word in _KNOWN or len(word) < 5:
        return [word]
    for part_of in _KNOWN:
        rest = word.removeprefix(part_of)
        if rest == word:
            continue
        if rest in _JOINTS:
            return [part_of]
        for tail in (rest, rest.removeprefix("s"), rest.removeprefix("es")):
            parts = _compound(tail)
            if all(part in _KNOWN for part in parts):
                return [part_of, *parts]
    return [word]
