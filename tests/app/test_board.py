"""What a page is told: the newest version of every object, in the order of the changes."""

import asyncio

import pytest

from clutchid.app.board import Board


@pytest.fixture
def board():
    made = Board()
    made.put("job", "1", {"share": 0.1})
    made.put("result", "2", {"name": "first"})
    made.put("job", "1", {"share": 0.7})
    return made


def test_a_late_page_gets_each_object_once_in_its_newest_version(board):
    assert [(one.kind, one.content) for one in board.since(0)] == [
        ("result", {"name": "first"}), ("job", {"share": 0.7}),
    ]  # fmt: skip


def test_a_page_that_has_lost_the_connection_gets_what_it_missed(board):
    seen = board.since(0)[-1].number
    assert board.since(seen) == []
    board.update("result", "2", name="second")
    assert [one.content for one in board.since(seen)] == [{"name": "second"}]


def test_an_object_that_was_removed_is_said_to_be_gone_and_stays_so(board):
    board.put("job", "1", None)
    board.update("job", "1", share=1.0)
    assert board.get("job", "1") is None
    assert board.since(3)[0].content is None
    assert board.all("job") == []


def test_whoever_follows_gets_changes_as_they_come_and_a_sign_of_life(board):
    async def followed():
        seen = []
        async for changes in board.follow(0, 0.05):
            seen.append([one.id for one in changes])
            if len(seen) == 1:
                asyncio.get_running_loop().call_later(0.01, board.put, "job", "3", {})
            if len(seen) == 3:
                break
        return seen

    assert asyncio.run(followed()) == [["2", "1"], ["3"], []]
