"""The process of a job, without the process."""

from pathlib import Path

from clutchid.app.records import File, Look
from clutchid.app.worker import run
from clutchid.errors import DataError


class Said(list):
    def say(self, event, **values):
        self.append((event, values))


def test_a_message_names_a_file_and_not_the_folder_that_the_server_keeps_it_in():
    path, said = Path("/var/cache/clutchid/app/uploads/recording-1/run.csv"), Said()

    def refused(task, events):
        raise DataError(f"{task.file.path}: has no position; see /etc/notes.")

    run(Look(File(path), path.parent), refused, said)
    ((event, values),) = said
    assert (event, values["message"]) == ("failed", "run.csv: has no position; see /etc/notes.")
