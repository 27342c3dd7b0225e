"""Compile once what all workers need, before they start."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from clutchid.errors import ClutchidError
from clutchid.fleet.pool import spawned


def warm(calibrations: Iterable[Path]) -> None:
    """Compile the kernels of the models of some calibrations, in a process that ends; what is compiled is only loaded.

    Workers on other machines compile once a machine, by themselves.
    """
    with spawned(1) as pool:
        pool.submit(_compile, tuple(calibrations)).result()


def _compile(calibrations: Iterable[Path]) -> None:
    from clutchid.model.compiled import compile_ahead
    from clutchid.workflow import start_file

    models = set()
    for path in calibrations:
        try:
            models.add(start_file(path, None).actuator.model)
        except ClutchidError:
            continue  # each of its recordings says so
    compile_ahead(models)
