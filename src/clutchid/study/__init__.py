"""The paper's study (Section 3), repeated on a recording: `paper_study`, and the recording that comes with clutchid."""

from clutchid.study.paper import PaperStudy, paper_study
from clutchid.study.recording import bundled_recording, halves

__all__ = ["PaperStudy", "bundled_recording", "halves", "paper_study"]
