"""Linear recurrence of several columns, compiled: the deflection of a bristle and its derivatives."""

from __future__ import annotations

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray


@kernel
def follow_columns(decay: FloatArray, driven: FloatArray, solution: FloatArray) -> None:
    """Solve z[k + 1] = decay[k] z[k] + driven[k] in place, from the first row of `solution`.

    Shapes (n - 1,), (n - 1, columns) and (n, columns).
    """
    for k in range(decay.size):
        for column in range(driven.shape[1]):
            solution[k + 1, column] = decay[k] * solution[k, column] + driven[k, column]
