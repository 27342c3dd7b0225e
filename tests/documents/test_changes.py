"""Changes since a calibration in words."""

from dataclasses import replace

from clutchid.documents.changes import change_sentences, short_changes
from clutchid.estimation.result import Change


def change(name, group, probability, before=2.0, after=3.0, unit="N", recording="worn"):
    return Change(recording, name, before, after, 0.1, unit, probability, group)


def test_each_group_of_each_recording_has_a_sentence_with_its_probability_and_its_values(fitted):
    changes = (
        change("P_S", "supply pressure", 0.98, 9e5, 8.5e5, "Pa"),
        change("C_vs", "valves", 0.98),
        change("R_0vs", "valves", 0.98, 0.06, 0.07, "1"),
        change("C_vs", "valves", 0.98, recording="cold"),
    )
    allowed = "; the load and its interval allow for it."
    assert change_sentences(replace(fitted, changes=changes)) == [
        "worn: supply pressure changed since the calibration (98 %): supply pressure, absolute, P_S, from 9·10⁵ to "
        f"8.5·10⁵ Pa{allowed}",
        "worn: valves changed since the calibration (98 %): conductance of the supply valve, C_vs, from 2 to 3 N, duty "
        f"cycle where the supply valve starts to open, R_0vs, from 0.06 to 0.07{allowed}",
        f"cold: valves changed since the calibration (98 %): conductance of the supply valve, C_vs, from 2 to 3 N"
        f"{allowed}",
    ]


def test_what_is_less_probable_than_not_may_have_changed():
    words = [short_changes([change("P_S", "supply pressure", p)])[0] for p in (0.06, 0.49, 0.5, 0.989, 0.991, 1.0)]
    assert words == [
        "supply pressure may have changed in worn (6 %: P_S from 2 to 3 N)",
        "supply pressure may have changed in worn (49 %: P_S from 2 to 3 N)",
        "supply pressure changed in worn (50 %: P_S from 2 to 3 N)",
        "supply pressure changed in worn (99 %: P_S from 2 to 3 N)",
        "supply pressure changed in worn (over 99 %: P_S from 2 to 3 N)",
        "supply pressure changed in worn (over 99 %: P_S from 2 to 3 N)",
    ]


def test_of_more_than_two_groups_a_summary_has_no_values():
    groups = [change("P_S", group, 0.9) for group in ("supply pressure", "temperature and grease", "valves")]
    assert all(" from " in words for words in short_changes(groups[:2]))
    assert not any(" from " in words for words in short_changes(groups))


def test_of_a_large_group_a_summary_has_the_values_of_three_and_the_names_of_the_others():
    members = [change(name, "valves", 0.9) for name in ("C_vs", "C_ve", "R_0vs", "R_0ve", "R_1vs")]
    assert short_changes(members) == [
        "valves changed in worn (90 %: C_vs from 2 to 3 N, C_ve from 2 to 3 N, R_0vs from 2 to 3 N; also R_0ve, R_1vs)"
    ]
