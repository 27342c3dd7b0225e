"""The process of a job, without the process."""

import json
import os
from pathlib import Path

from clutchid.app.records import File, Look
from clutchid.app.worker import Events, do_task
from clutchid.errors import DataError


class Said(list):
    def say(self, event, **values):
        self.append((event, values))


def test_a_message_names_a_file_and_not_the_folder_that_the_server_keeps_it_in():
    path, said = Path("/var/cache/clutchid/app/uploads/recording-1/run.csv"), Said()

    def refused(task, events):
        raise DataError(f"{task.file.path}: has no position; see /etc/notes.")

    do_task(Look(File(path), path.parent), refused, said)
    ((event, values),) = said
    assert (event, values["message"]) == ("failed", "run.csv: has no position; see /etc/notes.")


def test_progress_is_said_at_every_stage_at_once_and_within_one_ten_times_a_second(tmp_path, monkeypatch):
    events = Events(os.open(tmp_path / "events", os.O_WRONLY | os.O_CREAT))
    for now, stage in ((5.0, "read"), (5.01, "read"), (5.02, "fit"), (5.1, "fit"), (5.13, "fit")):
        monkeypatch.setattr("time.monotonic", lambda now=now: now)
        events.progress(stage, now, "")
    events._file.close()
    said = [json.loads(line) for line in (tmp_path / "events").read_text().splitlines()]
    assert [(event["stage"], event["share"]) for event in said] == [("read", 5.0), ("fit", 5.02), ("fit", 5.13)]
