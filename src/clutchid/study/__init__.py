"""The paper's study, Section 3: tables, figures and a page from one recording fitted and one verified."""

from clutchid.study.bundled import bundled_recording, halves
from clutchid.study.output import PaperStudy, paper_study

__all__ = ["PaperStudy", "bundled_recording", "halves", "paper_study"]
