"""Period of the valves' carrier (PWM), estimated from the time grid on which the duty cycles change."""

from __future__ import annotations

from clutchid.inspection.reading import Reading
from clutchid.signals.duty_cycle import duty_grid, on_off


def on_grid(reading: Reading) -> bool:
    """Whether the duty cycles change on a time grid, so that the valve responds at once.

    Other changes take effect with the next period of the carrier, after up to one period.
    """
    return duty_grid(reading.log)[0] > 0.0


def period(reading: Reading, usual: float) -> float:
    """Period in s of the carrier as estimated from the duty cycles, else the `usual` one.

    Valves that are only opened and closed change on the time grid of the control unit, which is not a carrier.
    """
    return usual if on_off(reading.log) else duty_grid(reading.log)[0] or usual
