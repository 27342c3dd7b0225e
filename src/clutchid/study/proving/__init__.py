"""The proving ground: evaluate workflows on a seeded fleet of virtual trucks."""

from clutchid.study.proving.ground import Proof, kept, proof, prove
from clutchid.study.proving.scores import Answer, Score, Workflow, score, standings

__all__ = ["Answer", "Proof", "Score", "Workflow", "kept", "proof", "prove", "score", "standings"]
