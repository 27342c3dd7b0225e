"""Friction on real rigs: ``python benchmarks/friction.py PATH_TO_SHARED_DATA``.

Prints what clutchid says about a tribometer (reciprocating_friction) and a pneumatic cylinder that is moved against
held pressures (zillen_cylinder_friction). Their licences and origins are in README.txt beside the files.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from clutchid import Log
from clutchid.documents.friction import _level_lines, _lugre_lines, _parameter_lines
from clutchid.rig import conclusions, coulomb_friction, fit_lugre, implied
from clutchid.rig.free_run import NAMES

AMBIENT = 101_325.0


def tribometer(folder: Path) -> Log:
    """Position and force in SI; the author turns the sign of the friction column."""
    columns = np.loadtxt(folder / "test_data_2.txt", skiprows=1)
    return Log(columns[:, 0], {"position": 1e-3 * columns[:, 2], "force": -1e-6 * columns[:, 3]}, "test_data_2")


def cylinder(path: Path) -> Log:
    """Position, force and absolute pressure in SI from one level's file."""
    columns = np.loadtxt(path)
    measured = {"position": 1e-3 * columns[:, 4], "force": columns[:, 6], "pressure_a": AMBIENT + 1e5 * columns[:, 5]}
    return Log(1e-3 * columns[:, 0], measured, path.stem)


def window(log: Log, start: float, seconds: float) -> Log:
    """The samples of `seconds` from `start` on."""
    return log.slice(*np.searchsorted(log.time, [start, start + seconds]))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with the shared data")
    data = parser.parse_args().data

    log = tribometer(data / "reciprocating_friction")
    first = fit_lugre(window(log, 12.0, 20.0))
    print("## LuGre in free run, fitted to 20 s\n")
    print(_lugre_lines(first), *first.warnings, sep="\n")
    fixed = {name: first.values[name] for name in NAMES}
    print("\nfrom [s]  own fit [%]  with the friction of the first 20 s [%]")
    for start in range(12, 185, 20):
        segment = window(log, start, 20.0)
        print(
            f"{start:8d}  {fit_lugre(segment).fit_percent:11.1f}  {fit_lugre(segment, fixed=fixed).fit_percent:11.1f}"
        )

    logs = [cylinder(path) for path in sorted((data / "zillen_cylinder_friction" / "friction").glob("*.csv"))]
    friction = coulomb_friction(logs, ambient=AMBIENT)
    print("\n## Coulomb friction at held pressures\n")
    print(_level_lines(friction))
    if friction.area is not None:
        low, value, high = (1e6 * x for x in (friction.area.low, friction.area.value, friction.area.high))
        print(f"\narea {value:.1f} mm² (95 %: {low:.1f} to {high:.1f})")
    print(f"\n{_parameter_lines(implied(friction))}\n", *conclusions(friction), sep="\n")


if __name__ == "__main__":
    main()
