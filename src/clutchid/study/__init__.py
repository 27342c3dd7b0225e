"""Studies: the paper's Section 3 repeated on a recording, and the proving ground with virtual trucks."""

from clutchid.study.paper.recording import bundled_recording, halves
from clutchid.study.paper.study import PaperStudy, paper_study

__all__ = ["PaperStudy", "bundled_recording", "halves", "paper_study"]
