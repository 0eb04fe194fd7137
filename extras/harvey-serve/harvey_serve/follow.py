"""Follow: a run that another process drives is shown from the files that it writes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from blackboard import Change, Posted, Retracted, Revised
from harvey.errors import BadInput
from harvey.runner.result import UNFINISHED
from harvey_serve.live_state import LiveState, Shown
from logs.disk import MOST_JOURNAL_BYTES
from logs.records import DecisionRecord, EntryRecord, decision_of, entry_of, kinds_for, refs_of
from logs.run_directory import RunDirectory
from world_models import words
from world_models.entries import CameraPicture
from world_models.files.regular_files import open_regular

PERIOD_S = 0.2
"""The files are looked at again after this time."""


class Follower:
    """Reads on in the files of a run, as far as they are whole."""

    def __init__(self, run: RunDirectory, live: LiveState) -> None:
        self._run, self._live = run, live
        self._read, self._pictures, self._line = 0, 0, 0

    def follow(self, rest: Callable[[float], object]) -> str:
        """Show each decision, until the run has ended; how it did. ``rest`` waits. Raises BadInput."""
        while True:
            ended = how_it_ended(self._run)  # asked before the rest is read: then nothing comes behind that
            self.read_on()
            if ended:
                self._live.end(ended)
                return ended
            rest(PERIOD_S)

    def read_on(self) -> None:
        """Show the decisions that were written since. Raises BadInput where a line is no decision."""
        if not self._run.journal.is_file():
            return
        with open_regular(self._run.journal, MOST_JOURNAL_BYTES) as file:
            file.seek(self._read)
            written = file.read()
        whole = written[:written.rfind(b"\n") + 1]
        self._read += len(whole)
        for line in whole.splitlines():
            self._line += 1
            try:
                self._live.show(self._shown(decision_of(json.loads(line))))
            except (ValueError, RecursionError) as error:
                raise BadInput(f"{self._run.journal}:{self._line}: {error}") from None

    def _shown(self, record: DecisionRecord) -> Shown:
        chosen = record.chosen
        return Shown(
            record.cycle, record.focus, "" if chosen is None else words.source(chosen.source),
            "" if chosen is None else chosen.trigger, record.refused,
            tuple(self._change(entry) for entry in (*record.observed, *record.made)))

    def _change(self, record: EntryRecord[Any]) -> Change:
        entry = entry_of(record, kinds_for(record.type))
        if isinstance(entry.value, CameraPicture):
            size = record.fields["jpeg"]["bytes"]
            with open_regular(self._run.camera, MOST_JOURNAL_BYTES) as file:
                file.seek(self._pictures)
                entry = entry._replace(value=replace(entry.value, jpeg=file.read(max(0, size))))
            self._pictures += size
        if record.change == "Retracted":
            return Retracted(entry, refs_of(record.retracted_because))
        return Posted(entry) if record.change == "Posted" else Revised(entry)


def how_it_ended(run: RunDirectory) -> str:
    """The outcome of a run and its reason; "" where it goes on, or was cut off."""
    try:
        result = run.read_result()
    except BadInput:  # it is being written
        return ""
    outcome = result.get("outcome", UNFINISHED)
    return "" if outcome == UNFINISHED else f"{outcome}: {result.get('reason', '')}"
