"""Sentences are wrapped at words on a terminal, and nowhere else; tables keep their lines."""

import io
import os

from clutchid.documents.console import text_width, wrapped_sentences

LONG = "cal.csv: " + "word " * 30


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_sentences_are_wrapped_at_words_on_a_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    lines = wrapped_sentences(LONG, Terminal()).splitlines()
    assert max(map(len, lines)) <= 80
    assert " ".join(lines).split() == LONG.split()


def test_a_narrow_terminal_has_narrow_lines(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    assert text_width() == 40
    assert max(map(len, wrapped_sentences(LONG, Terminal()).splitlines())) <= 40


def test_files_and_pipes_get_the_text_as_it_is():
    assert wrapped_sentences(LONG, io.StringIO()) == LONG


def test_lists_hang_and_tables_and_paths_stay_whole(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    table = "  column  " + "x" * 100
    first, second, *_ = wrapped_sentences(f"  - {LONG}", Terminal()).splitlines()
    assert (first[:4], second[:4]) == ("  - ", "    ")
    assert wrapped_sentences(f"{table}\n\nend", Terminal()) == f"{table}\n\nend"
    path = os.sep + "folder" * 20
    assert path in wrapped_sentences(f"written to {path} now", Terminal()).splitlines()
