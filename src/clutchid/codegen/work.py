"""The work array of a system's kernels: where in one array of numbers every function leaves its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from clutchid.codegen.lanes import WIDTH, block_size
from clutchid.codegen.layout import DifferentiatedProgram
from clutchid.codegen.parts import Parts


@dataclass(frozen=True, slots=True)
class Work:
    """Places in the work array.

    First the segment in which the table was read last, then `constants` and `held`; then four `stages` of `stride`
    numbers, in each of which lie the rates (or new states after a jump), segment and offset of the table, Jacobian,
    derivatives to the table's value, and parameter slots. After the `head` of all these come the blocks of columns,
    each of `block` numbers, see `lanes`; the first source of a block begins at its number `source`.
    """

    constants: int
    held: int
    stages: int
    stride: int
    rates: int
    segment: int
    offset: int
    jacobian: int
    table: int
    slots: int
    head: int
    block: int
    source: int

    @classmethod
    def of(cls, plan: DifferentiatedProgram, programs: Sequence[Parts]) -> Work:
        """Room for the results of all `programs`, which use the array in turn."""
        n = len(plan.system.states)
        before, stages = _placed(
            {
                "segment": 1,
                "constants": max(len(program.constants) for program in programs),
                "held": max(len(program.inputs) + len(program.held) for program in programs),
            }
        )
        inside, stride = _placed(
            {
                "rates": n,
                "segment": 1,
                "offset": 1,
                "jacobian": max(len(plan.jacobian), len(plan.jump.jacobian)),
                "table": len(plan.table_entries),
                "slots": len(plan.slots),
            }
        )
        return cls(
            constants=before["constants"],
            held=before["held"],
            stages=stages,
            stride=stride,
            **inside,
            head=stages + 4 * stride,
            block=block_size(n),
            source=n * WIDTH,
        )


def _placed(sizes: Mapping[str, int]) -> tuple[dict[str, int], int]:
    """One after the other, and the end."""
    places, end = {}, 0
    for name, size in sizes.items():
        places[name] = end
        end += size
    return places, end
