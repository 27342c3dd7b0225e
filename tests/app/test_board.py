"""What a page is told: the newest version of every record, in the order of the changes."""

import asyncio
import json
import pickle
from dataclasses import replace
from pathlib import Path

import pytest

from clutchid.app.board import Board
from clutchid.app.records import File, FitRecordings, Recording, Result, content
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.options import RequestText

CAL, FIT = Recording("recording-1", "cal.csv", Path("cal.csv")), Result("result-2", "calibrate", "first")


@pytest.fixture
def board():
    made = Board()
    made.put(CAL)
    made.put(FIT)
    made.put(replace(CAL, status="ready"))
    return made


def test_a_late_page_gets_each_record_once_in_its_newest_version(board):
    assert [(update.id, update.item.status) for update in board.since(0)] == [
        ("result-2", "waiting"),
        ("recording-1", "ready"),
    ]


def test_a_page_that_has_lost_the_connection_gets_what_it_missed(board):
    seen = board.since(0)[-1].number
    assert board.since(seen) == []
    board.update("result-2", name="second")
    assert [update.content()["content"]["name"] for update in board.since(seen)] == ["second"]


def test_a_record_that_was_removed_is_said_to_be_gone_and_stays_so(board):
    board.remove("recording-1")
    board.update("recording-1", status="ready")
    assert board.item("recording-1") is None
    assert board.since(3)[0].content() == {"kind": "recording", "id": "recording-1", "content": None}
    assert board.all(Recording) == []


def test_whoever_follows_gets_changes_as_they_come_and_a_sign_of_life(board):
    async def followed():
        seen = []
        async for changes in board.follow(0, 0.05):
            seen.append([change.id for change in changes])
            if len(seen) == 1:
                asyncio.get_running_loop().call_later(0.01, board.put, replace(FIT, id="result-3"))
            if len(seen) == 3:
                break
        return seen

    assert asyncio.run(followed()) == [["result-2", "recording-1"], ["result-3"], []]


def test_a_record_is_plain_json_and_a_task_can_be_sent_to_another_process():
    options = RequestText(free="load", bounds=["P_S=8e5:9e5"])
    shown = content(replace(FIT, options=options, recordings=("recording-1",)))
    assert (shown["options"]["bounds"], shown["recordings"]) == (["P_S=8e5:9e5"], ["recording-1"])
    assert json.loads(json.dumps(shown)) == shown
    asked = FitCommand(verb="calibrate", logs=(Path("cal.csv"),), search=options)
    task = FitRecordings(asked, "calibrate cal.csv", (File(Path("uploads/cal.csv")),), Path("folder"))
    assert pickle.loads(pickle.dumps(task)) == task
