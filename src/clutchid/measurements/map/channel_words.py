"""Identify channels by name: English, German and J1939 words of the quantities, and units at the end."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType

from clutchid.measurements.columns import quantity_named


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_CLUTCH = _words("clutch clu kupplung kuppl kupp coupling actuator aktuator aktor piston kolben cca")
_SUPPLY = _words("supply sup inlet fill open load zuluft einlass belueftung belueften be")
_EXHAUST = _words("exhaust exh outlet vent release close abluft auslass entlueftung entlueften ent")
_ONLY_SUPPLY = _words("inlet zuluft einlass belueftung belueften")
_ONLY_EXHAUST = _words("exhaust exh outlet abluft auslass entlueftung entlueften")
_SHARE = _words("duty dc pwm tv tastverhaeltnis tastgrad")
_DUTY = _SHARE | _words("pct percent u valve solenoid ventil magnetventil ansteuerung mv command cmd")
_PRESSURE = _words("pressure press druck p")
_CHAMBER = _words("chamber cham kammer cylinder cyl zylinder zyl")
_TANK = _words(
    "supply sup reservoir res tank vorrat versorgung speise behaelter kessel pneumatic circuit kreis bremskreis system"
)
_AIR = _words("air luft druckluft")
_POSITION = _words("position pos travel stroke displacement weg hub lage kolbenweg x y desl")
_FORCE = _words("force kraft friction reibung reibkraft")
_TEMPERATURE = _words("temperature temperatur temp tmp t")
_AMBIENT = _words("ambient amb outside outdoor aussen umgebung umgebungs umg oat")
_SET_POINT = _words(
    "soll sollwert sollwerte vorgabe ziel zielwert wunsch set setpoint target tgt demand demanded dmd cmd command "
    "commanded ref reference desired des req request requested"
)
_BESIDE = _words(
    "active aktiv status state zustand valid validity gueltig gueltigkeit flag bit enable enabled freigabe error "
    "fehler fault diag diagnose quality counter zaehler current strom voltage spannung"
)
_OTHERS = _words(
    "brake bremse oil oel fuel engine motor tire tyre reifen boost coolant wheel steering pedal throttle suspension "
    "intake barometric baro trailer parking park gearbox crankcase turbo manifold rail latitude longitude gnss gps "
    "altitude accelerator normal kraftstoff kuehlmittel kuehlwasser"
)

_BRAKES = _words("brake bremse bremskreis betriebsbremse")
_AUXILIARIES = _words("auxiliary aux neben nebenverbraucher")
_POWERTRAIN = _words("powertrain transmission trans getriebe") | _CLUTCH
_ENGINE = _words("eng filter diff differential charge ladeluft ladedruck inlet")
_OTHER_CIRCUITS = (
    (_OTHERS - _BRAKES) | _ENGINE | _CHAMBER | _words("application pump pumpe luftfederung luftfeder federung niveau")
)
_OTHER_AIR = _OTHERS | _ENGINE | _words("cab cabin interior innen innenraum exhaust abgas road fahrbahn cargo evap")

#: Numbers of the circuits of a compressed air system and of their ports: service brakes, trailer, auxiliaries.
_NUMBERED = _words("circuit kreis bremskreis")
_FIRST_CIRCUITS, _THIRD_CIRCUIT, _FOURTH_CIRCUIT = _words("1 2 21 22"), _words("3 23"), _words("4 24")


class Circuit(IntEnum):
    """Source of the air of a pressure, the nearest to a clutch actuator last."""

    BRAKES = 0
    SUPPLY = 1
    AUXILIARIES = 2
    POWERTRAIN = 3


@dataclass(frozen=True, slots=True)
class _Quantity:
    """Words of a quantity: one of every group of `needs`, none of `never`; each of `likes` raises the score."""

    needs: tuple[frozenset[str], ...]
    likes: frozenset[str] = _CLUTCH
    never: frozenset[str] = _OTHERS


_QUANTITIES: Mapping[str, _Quantity] = MappingProxyType(
    {
        "time": _Quantity(
            (_words("time zeit t timestamp timestamps stamp tout clock"),), frozenset(), _AMBIENT
        ),
        "position": _Quantity((_POSITION,)),
        "duty_supply": _Quantity((_DUTY, _SUPPLY), _CLUTCH | _SHARE, _OTHERS | _ONLY_EXHAUST),
        "duty_exhaust": _Quantity((_DUTY, _EXHAUST), _CLUTCH | _SHARE, _OTHERS | _ONLY_SUPPLY),
        "pressure_a": _Quantity((_PRESSURE,), _CLUTCH | _CHAMBER | _words("a"), _OTHERS | _TANK | _AUXILIARIES),
        "pressure_supply": _Quantity(
            (_PRESSURE, _TANK | _AIR | _AUXILIARIES), _words("reservoir tank vorrat supply"), _OTHER_CIRCUITS
        ),
        "temperature_ambient": _Quantity((_TEMPERATURE, _AMBIENT | _AIR), _AMBIENT, _OTHER_AIR),
        "force": _Quantity((_FORCE,)),
    }
)  # fmt: skip

_KNOWN = sorted(
    {
        word
        for group in (
            *(words for row in _QUANTITIES.values() for words in (*row.needs, row.likes, row.never)),
            _BRAKES, _AUXILIARIES, _POWERTRAIN, _SET_POINT, _BESIDE,
        )
        for word in group
        if len(word) > 2
    },
    key=lambda word: (-len(word), word),
)  # fmt: skip

#: Two words of each name of SAE J1939-71.
_STANDARD_NAMES = (
    ("pneumatic", "supply"), ("equipment", "supply"), ("service", "circuit"), ("powertrain", "circuit"),
)  # fmt: skip

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
    standard = quantity_named(_bare(text)) or quantity_named(_bare(text).rpartition(".")[2])  # a field of a struct
    if standard is not None:
        return 100.0 if standard == name else 0.0
    quantity = _QUANTITIES.get(name)
    if quantity is None:
        return 0.0
    words = set(_tokens(text))
    if words & quantity.never or not all(words & group for group in quantity.needs):
        return 0.0
    circuit = _circuit(words) if name == "pressure_supply" else Circuit.BRAKES
    if circuit is None or (name == "pressure_a" and words & _AIR and not words & (_CLUTCH | _CHAMBER)):
        return 0.0
    return 1.0 + len(words & quantity.likes) + 10.0 * circuit


def circuit_of(text: str) -> Circuit | None:
    """The circuit of a supply pressure that is called `text`; None if it supplies no clutch actuator.

    Examples
    --------
    >>> [circuit_of(text) for text in ("Vorratsdruck", "Kreisdruck 4", "Bremskreis 1 Druck", "Kreisdruck 3")]
    [<Circuit.SUPPLY: 1>, <Circuit.AUXILIARIES: 2>, <Circuit.BRAKES: 0>, None]
    """
    return _circuit(set(_tokens(text)))


def _circuit(words: set[str]) -> Circuit | None:
    numbered = bool(words & _NUMBERED)
    if words & _CLUTCH and not words & _TANK:  # the pressure in the chamber
        return None
    if words & _POWERTRAIN:
        return Circuit.POWERTRAIN
    if words & _AUXILIARIES or (numbered and words & _FOURTH_CIRCUIT):
        return Circuit.AUXILIARIES
    if words & _BRAKES or (numbered and words & _FIRST_CIRCUITS):
        return Circuit.BRAKES
    return None if numbered and words & _THIRD_CIRCUIT else Circuit.SUPPLY


def is_set_point(text: str) -> bool:
    """Whether a channel is called like what a controller asks for, not like what is measured.

    Examples
    --------
    >>> [is_set_point(text) for text in ("Kupplungsweg_Soll", "Sollposition", "ClutchPosCmd", "Kupplungsweg_Ist")]
    [True, True, True, False]
    """
    return bool(_SET_POINT & set(_tokens(text)))


def is_beside(text: str) -> bool:
    """Whether a channel is called like what a valve has beside its duty cycle: a flag, a status, a current.

    Examples
    --------
    >>> [is_beside(text) for text in ("MV_Be_aktiv", "PWM_Supply_valid", "Ventilstrom_Be", "TV_Belueften")]
    [True, True, True, False]
    """
    return bool(_BESIDE & set(_tokens(text)))


def is_named_by_j1939(text: str) -> bool:
    """Whether an air pressure has the name of the standard, in the spelling of the databases of buses.

    Examples
    --------
    >>> [is_named_by_j1939(text) for text in ("AuxEquipmentSupplyPress", "AIR1_PneumaticSupplyPressure", "pSupply")]
    [True, True, False]
    """
    words = set(_tokens(text))
    return any(words >= {first, second} for first, second in _STANDARD_NAMES)


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
