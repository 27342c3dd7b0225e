"""Fits by multiple shooting with soft continuity: many short simulations whose ends need only nearly meet.

A long simulation carries every small error of the model to its end; short windows that start anew forget the mass of
air. Here the state at the start of each window is free, and what it costs to differ from the end of the window before
is the model's own inaccuracy. The windows are eliminated one by one, so the cost of a step is linear in the length of
a recording. docs/methods.md has the equations and what was tried beside it.
"""
