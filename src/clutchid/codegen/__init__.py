"""From expressions to Numba kernels, C99 and LaTeX. Knows no clutch: it takes a `System`."""
