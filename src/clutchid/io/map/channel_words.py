"""Identify channels by name: English, German and J1939 words of the quantities, and units at the end."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from clutchid.io.columns import quantity_named


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_CLUTCH = _words("clutch clu kupplung kuppl kupp coupling actuator aktuator aktor piston kolben cca")
_SUPPLY = _words("supply sup inlet fill open load zuluft einlass belueftung belueften be")
_EXHAUST = _words("exhaust exh outlet vent release close abluft auslass entlueftung entlueften ent")
_DUTY = _words("duty dc pct percent u pwm valve solenoid ventil tastverhaeltnis ansteuerung mv command cmd")
_PRESSURE = _words("pressure press druck p")
_CHAMBER = _words("chamber cham kammer cylinder cyl zylinder zyl a")
_TANK = _words("supply sup reservoir res tank vorrat versorgung pneumatic circuit kreis system")
_POSITION = _words("position pos travel stroke displacement weg hub lage kolbenweg x y desl")
_FORCE = _words("force kraft friction reibung reibkraft")
_TEMPERATURE = _words("temperature temp")
_AMBIENT = _words("ambient amb outside outdoor aussen umgebung umgebungs")
_OTHERS = _words(
    "brake bremse oil oel fuel engine motor tire tyre reifen boost coolant wheel steering pedal throttle suspension "
    "intake barometric trailer parking park gearbox crankcase turbo manifold rail latitude longitude gnss gps altitude "
    "accelerator normal"
)


@dataclass(frozen=True, slots=True)
class _Quantity:
    """Words of a quantity: one of every group of `needs`, none of `never`; each of `likes` raises the score."""

    needs: tuple[frozenset[str], ...]
    likes: frozenset[str] = _CLUTCH
    never: frozenset[str] = _OTHERS


_QUANTITIES: Mapping[str, _Quantity] = MappingProxyType(
    {
        "time": _Quantity(
            (_words("time zeit t timestamp timestamps stamp tout clock"),), frozenset(), frozenset()
        ),
        "position": _Quantity((_POSITION,)),
        "duty_supply": _Quantity((_DUTY, _SUPPLY), _CLUTCH | _words("duty dc pwm")),
        "duty_exhaust": _Quantity((_DUTY, _EXHAUST), _CLUTCH | _words("duty dc pwm")),
        "pressure_a": _Quantity((_PRESSURE,), _CLUTCH | _CHAMBER, _OTHERS | _TANK),
        "pressure_supply": _Quantity((_PRESSURE, _TANK), _words("reservoir tank vorrat supply")),
        "temperature_ambient": _Quantity((_TEMPERATURE, _AMBIENT), frozenset()),
        "force": _Quantity((_FORCE,)),
    }
)  # fmt: skip

_KNOWN = sorted(
    {
        word
        for quantity in _QUANTITIES.values()
        for group in (*quantity.needs, quantity.likes, quantity.never)
        for word in group
        if len(word) > 2
    },
    key=lambda word: (-len(word), word),
)

#: Symbols that may stand directly before a word: ``pcyl``, ``usup``.
_SYMBOLS = tuple("puxy")

_JOINTS = ("", "s", "es", "n", "en", "e", "er")


def name_score(name: str, text: str) -> float:
    """Score of a channel text for the quantity `name`: 0 for no match, 100 if it is the name itself.

    Examples
    --------
    >>> name_score("position", "Kupplungsweg"), name_score("position", "Weg"), name_score("position", "ThrottlePos")
    (2.0, 1.0, 0.0)
    """
    known = quantity_named(_bare(text))
    if known is not None:
        return 100.0 if known == name else 0.0
    quantity = _QUANTITIES.get(name)
    if quantity is None:
        return 0.0
    words = set(_tokens(text))
    if words & quantity.never or not all(words & group for group in quantity.needs):
        return 0.0
    return 1.0 + len(words & quantity.likes)


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
    return not means_time(text) and any(name_score(name, long) > 0.0 for name in _QUANTITIES if name != "time")


def _bare(text: str) -> str:
    return text.partition("[")[0]


def _tokens(text: str) -> list[str]:
    """Words of a channel name in lower case, split at CamelCase, underscores, and in German compounds of known words.

    >>> _tokens("KupplungsWeg_ist"), _tokens("ClutchPos"), _tokens("Entlüftungsventil")
    (['kupplung', 'weg', 'ist'], ['clutch', 'pos'], ['entlueftung', 'ventil'])
    """
    plain = _bare(text)
    for umlaut, letters in (("ü", "ue"), ("ä", "ae"), ("ö", "oe"), ("ß", "ss"), ("Ü", "Ue"), ("Ä", "Ae"), ("Ö", "Oe")):
        plain = plain.replace(umlaut, letters)
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", plain)
    return [token for part in parts for token in _compound(part.casefold())]


def _compound(word: str) -> list[str]:
    """Split a compound of known words and German joining letters; any other word is returned unchanged."""
    if word[:1] in _SYMBOLS and word not in _KNOWN and word[1:] in _KNOWN:
        return [word[0], word[1:]]
    if word in _KNOWN or len(word) < 5:
        return [word]
    for known in _KNOWN:
        rest = word.removeprefix(known)
        if rest == word:
            continue
        if rest in _JOINTS:
            return [known]
        for tail in (rest, rest.removeprefix("s"), rest.removeprefix("es")):
            parts = _compound(tail)
            if all(part in _KNOWN for part in parts):
                return [known, *parts]
    return [word]
