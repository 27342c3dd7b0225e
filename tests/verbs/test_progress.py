"""Progress of a command in words: the most evaluations of a search, and the most time that is left."""

from clutchid.numerics.progress import Step
from clutchid.verbs.progress import ESTIMATE, shared


def test_the_time_left_is_that_of_all_evaluations_that_are_left_at_the_rate_of_the_stage():
    time, shown = [0.0], []
    progress = shared(ESTIMATE, shown.append, lambda: time[0])
    steps = [Step("fine search", 11, 1.0, 611), Step("fine search", 21, 1.0, 611), Step("changes"),
             Step("changes", 71, 1.0, 611), Step("changes", 72, 1.0, 611),
             Step("alone", 1, 1.0, 2000), Step("alone", 3, 1.0, 2000), Step("alone", 1, 1.0, 1000),
             Step("alone", 2, 1.0, 1000)]  # fmt: skip
    for step in steps:
        progress(step)
        time[0] += 2.0
    words = [state.words.rpartition(", cost 1")[2] for state in shown]
    assert words == [
        "", ", at most 118 s left", "what has changed since the calibration", "", ", at most 18 min left",
        "", ", at most 33 min left", "", ", at most 33 min left",
    ]  # fmt: skip
    assert "21 of at most 611 simulations" in shown[1].words
