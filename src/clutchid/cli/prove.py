"""``clutchid prove``: evaluate a workflow on a fleet of virtual trucks."""

from __future__ import annotations

from textwrap import fill
from typing import Annotated

from cyclopts import Parameter

from clutchid.cli.common import DONE, FAILED, FLEET, OutOption, OutputFlag, guarded, print_written, progress_of
from clutchid.cli.fleet import NO_SCHEDULER, Scheduler
from clutchid.documents.console import TERMINAL_WIDTH, put
from clutchid.errors import ParameterError


@guarded
def prove(
    *,
    out: OutOption,
    family: str = "A",
    trucks: int = 24,
    seed: int = 0,
    workflow: str = "paper",
    change: list[str] | None = None,
    workers: Annotated[int, FLEET] = 1,
    scheduler: Annotated[Scheduler, Parameter(name="*"), FLEET] = NO_SCHEDULER,
    debug: OutputFlag = False,
) -> int:
    """Measure how good a method is, on virtual trucks whose load is known.

    Each truck gives a calibration recording with pressure and two worn ones with position only. Results are saved per
    truck; an interrupted run is continued. Choose methods on seeds 0 to 23, report them on 1000 to 1023.

    Parameters
    ----------
    out
        Folder for the results; results of other workflows in it are listed in the same table.
    family
        A, or B: another plant with other valves, air, friction, springs and sensors; or h:SEED, a hybrid that has
        parts of both.
    trucks
        Number of trucks.
    seed
        Number of the first truck type.
    workflow
        paper, paper-every-200, paper-every-200-q, paper-8-parts, calibrated and its relatives (docs/truck.md), or your
        own as MODULE:FUNCTION.
    change
        What changes between the calibration and the worn recordings: supply, cold, warm, valves or seals; may be
        repeated, all of them then change together.
    workers
        Number of processes; does not affect the results.
    debug
        Show the traceback of an error.
    """
    from clutchid.documents import to_text
    from clutchid.fleets.cluster import Workers
    from clutchid.study.proving.ground import Conditions, write_tables
    from clutchid.study.proving.ground import prove as run

    if trucks < 1 or seed < 0:
        raise ParameterError(f"--trucks {trucks} --seed {seed}: needs at least 1 truck, and a seed of at least 0.")
    place = Workers(workers, scheduler.scheduler, tls=scheduler.tls())
    numbers, conditions = range(seed, seed + trucks), Conditions(family, tuple(change or ()))
    with progress_of("prove", "trucks") as progress:
        results = run(workflow, numbers, out, conditions, place, progress)
    table = write_tables(out, numbers)
    put(to_text(table, TERMINAL_WIDTH), "", fill(table.note, TERMINAL_WIDTH))
    print_written(out / "recordings.csv")
    return FAILED if all(result["failed"] for result in results) else DONE
