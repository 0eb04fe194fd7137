"""As recorded: the decisions of a counterfactual without the revisions by which it was asked."""

from __future__ import annotations

import json
import re
from typing import Any

from harvey.run_files.records import WHAT_IF, DecisionRecord, as_line, decision_of
from world_models.building.locale_frame import LocaleFrame

REF = re.compile(r'"([A-Za-z]+-\d+)\.(\d+)"')
"""A revision, where it is the whole of a text of a journal's line."""


class AsRecorded:
    """Takes the decisions of a run in turn, and undoes the revisions with the author "what if".

    They are not observed, and later revisions of the same entries have the number that they would have had.

    Attributes:
        revised: the revisions that were undone.
    """

    def __init__(self) -> None:
        self.revised: tuple[str, ...] = ()
        self._undone: dict[str, list[int]] = {}

    def __call__(self, decision: DecisionRecord) -> DecisionRecord:
        """The decision as it would stand in the journal."""
        told = [entry for entry in decision.observed if entry.author == WHAT_IF]
        for entry in told:
            id, _, revision = entry.ref.rpartition(".")
            self._undone.setdefault(id, []).append(int(revision))
        refs = {entry.ref for entry in told}
        self.revised += tuple(entry.ref for entry in told)
        if not self._undone:
            return decision
        data = {**decision.data,
                "observed": [_undo_changes(one) for one in decision.data["observed"] if one["entry"] not in refs],
                "made": [_undo_changes(one) for one in decision.data["made"]],
                "seen": [ref for ref in decision.seen if ref not in refs]}
        return decision_of(json.loads(REF.sub(self._renumber, as_line(data))))

    def _renumber(self, ref: re.Match[str]) -> str:
        undone = self._undone.get(ref[1], ())
        return f'"{ref[1]}.{int(ref[2]) - sum(number <= int(ref[2]) for number in undone)}"'


def _undo_changes(record: dict[str, Any]) -> dict[str, Any]:
    """An entry without what its frame has of that author, where somebody else revised it since."""
    if record["type"] != LocaleFrame.__name__:
        return record
    changes = [change for change in record["value"]["changes"] if change["by"] != WHAT_IF]
    return {**record, "value": {**record["value"], "changes": changes}}
