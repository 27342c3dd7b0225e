"""Words of truth values, and those that mean that there is none: in texts, in value tables of MDF files and DBCs."""

from __future__ import annotations

import re

#: Words of truth values, in lower case.
TRUTH = {
    **dict.fromkeys(("true", "on", "yes", "open", "active", "ein", "an", "ja", "wahr", "offen", "aktiv"), 1.0),
    **dict.fromkeys(("false", "off", "no", "closed", "inactive"), 0.0),
    **dict.fromkeys(("aus", "nein", "falsch", "geschlossen", "inaktiv"), 0.0),
}

_WORDS = re.compile(
    r"(signal|sensor|value|wert|data)?[ _-]*"
    r"(sna|err(or)?|invalid|fault(y)?|fail|failed|failure"
    r"|(signal[ _-]*)?not[ _-]*(avail\w*|valid|defined|present|installed)"
    r"|unavail\w*|undef(ined)?|n\.?/?a\.?|reserved|no[ _-]*(value|data|signal)|out[ _-]*of[ _-]*range"
    r"|overflow|underflow|fehler\w*|ung(ue|ü)ltig|nicht[ _-]*verf(ue|ü)gbar|defekt|k\.?[ _-]*a\.?)"
    r"([ _-]*(indicator|value|wert|signal|sensor|code|detected))?",
    re.IGNORECASE,
)


def means_no_value(text: str) -> bool:
    """Whether a text stands where there is no value.

    Examples
    --------
    >>> [means_no_value(text) for text in ("SNA", "Signal not available", "Sensor_Error", "No error", "Open")]
    [True, True, True, False, False]
    """
    return _WORDS.fullmatch(text.strip()) is not None
