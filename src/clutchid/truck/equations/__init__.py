"""Equations of the virtual truck as SymPy expressions, imported only where a plant has not been compiled yet.

The modules of a slot have the same functions: `energy` and `polytropic` the air in a zone, `reservoir` and `regulator`
the supply, `bristles` and `slip` the friction. `plant` puts them together.
"""
