"""Estimation by multiple shooting with soft continuity constraints.

A single long simulation accumulates the model error up to its end; short independent windows lose the information on
the mass of air. Here the initial state of each window is free, and its deviation from the final state of the previous
window is penalised with the process noise of the model. The states are eliminated window by window, so that the cost of
an iteration is linear in the length of the recording. Equations and alternatives: docs/derivations.md.
"""
