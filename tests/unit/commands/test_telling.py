"""What another process says to a run: ``harvey tell`` writes it, and the run hears each whole line once."""

from __future__ import annotations

import fcntl
from pathlib import Path

from blackboard import Scheduler
from harvey.cli import main
from harvey.runner.teller import TOLD_FILE, FileTeller
from world_models.entries import Redirection


def test_what_is_told_is_heard_once(tmp_path: Path) -> None:
    scheduler, teller = Scheduler((), kinds=[Redirection]), FileTeller(tmp_path)
    with (tmp_path / "journal.jsonl").open("w") as journal:
        fcntl.flock(journal, fcntl.LOCK_EX)
        assert [main(["tell", str(tmp_path), text]) for text in ("Fetch the\nbook", "done")] == [0, 0]
    with (tmp_path / TOLD_FILE).open("a") as file:
        file.write("half a li")
    for _ in range(2):
        teller.tell(scheduler)
    assert [entry.value.text for entry in scheduler.view.all(Redirection)] == ["Fetch the book", "done"]
    assert main(["tell", str(tmp_path), "too late"]) == 2
