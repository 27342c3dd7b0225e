"""The proving ground: evaluate workflows on a seeded fleet of virtual trucks."""

from clutchid.study.proving.ground import Proof, proof, prove, stored_results
from clutchid.study.proving.scores import Answer, Score, Workflow, score, standings

__all__ = ["Answer", "Proof", "Score", "Workflow", "proof", "prove", "score", "standings", "stored_results"]
