"""The journal read back: the lines of ``journal.jsonl`` as typed records, every fault named with its line."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from logs.journal_file import JournalError, read_journal

REQUEST = "FrameRequest"
"""The type of what an act asks for that lacks a locale frame."""

WHAT_IF = "what if"
"""The author of the revisions by which a question of what would have been is asked."""


@dataclass(frozen=True, slots=True)
class EntryRecord:
    """One change of one entry, as the journal tells it.

    Attributes:
        change: Posted, Revised or Retracted.
        ref: ``Goal-1.0``.
        type: of the value.
        author: knowledge source or port.
        because: refs of the revisions that it rests on.
        value: the value's fields as JSON types.
        cycle: of the decision that made it, or that took it up where it came from outside.
        observed: whether it came from outside.
        retracted_because: of a retraction: what it rests on itself.
    """

    change: str
    ref: str
    type: str
    author: str
    because: tuple[str, ...]
    value: Any
    cycle: int
    observed: bool
    retracted_because: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """The entry without its revision."""
        return self.ref.rpartition(".")[0]


@dataclass(frozen=True, slots=True)
class Candidate:
    """An activation, as the journal tells it; ``reason`` says why it was dropped, if it was."""

    number: int
    source: str
    level: str
    trigger: str
    kind: str
    rating: float
    since: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class DecisionRecord:
    """One line of the journal; the attributes are those of :class:`blackboard.journal.Decision`."""

    cycle: int
    focus: str
    observed: tuple[EntryRecord, ...]
    seen: tuple[str, ...]
    activated: tuple[Candidate, ...]
    obviated: tuple[Candidate, ...]
    chosen: Candidate | None
    runner_up: Candidate | None
    pending: int
    made: tuple[EntryRecord, ...]
    refused: str
    data: Mapping[str, Any]
    used: tuple[str, ...] = ()

    @property
    def asks(self) -> EntryRecord | None:
        """What the act lacked and asked for, where that was all that it did: it comes again when it is answered."""
        is_request = len(self.made) == 1 and self.made[0].type == REQUEST and self.made[0].change == "Posted"
        return self.made[0] if is_request else None

    @property
    def line(self) -> str:
        """As it stands in the journal, without its newline."""
        return as_line(self.data)


def as_line(data: Any) -> str:
    """JSON types as one line, as the journal writes them; equal lines mean equal values to the last bit."""
    return json.dumps(data, separators=(",", ":"))


def read_records(path: Path) -> Iterator[DecisionRecord]:
    """The decisions of a journal, one by one. A last line that was cut off in the middle of writing is left out.

    Raises:
        BadInput: the file cannot be read, or a line is not a decision; names file and line.
    """
    lines = read_journal(path)
    number = 0
    while True:
        number += 1
        try:
            data = next(lines, None)
            if data is None or "truncated" in data:
                return
            decision = decision_of(data)
        except JournalError as error:
            raise BadInput(str(error)) from None
        except RecursionError:
            raise BadInput(f"{path}:{number}: expected a decision, got too many nested brackets") from None
        except ValueError as error:
            raise BadInput(f"{path}:{number}: {error}") from None
        except OSError as error:
            raise BadInput(f"{path}: expected a readable journal, got: {error.strerror}") from None
        yield decision


def decision_of(data: Any) -> DecisionRecord:
    """A decision from JSON types. Raises ValueError naming the key, what was expected and what came."""
    cycle = _get(data, "cycle", int)
    return DecisionRecord(
        cycle=cycle,
        focus=_get(data, "focus", str),
        observed=tuple(_entry(item, cycle, True) for item in _get(data, "observed", list)),
        seen=_texts(data, "seen"),
        activated=tuple(_candidate(item) for item in _get(data, "activated", list)),
        obviated=tuple(_candidate(item, _get(item, "reason", str)) for item in _get(data, "obviated", list)),
        chosen=_optional(data, "chosen"),
        runner_up=_optional(data, "runner_up"),
        pending=_get(data, "pending", int),
        made=tuple(_entry(item, cycle, False) for item in _get(data, "made", list)),
        refused=_get(data, "refused", str),
        data=data,
        used=_texts(data, "used") if "used" in data else (),
    )


def _entry(item: Any, cycle: int, observed: bool) -> EntryRecord:
    return EntryRecord(
        _get(item, "change", str), _get(item, "entry", str), _get(item, "type", str), _get(item, "author", str),
        _texts(item, "because"), _get(item, "value", object), cycle, observed,
        _texts(item, "retracted_because") if "retracted_because" in item else (),
    )


def _candidate(item: Any, reason: str = "") -> Candidate:
    return Candidate(
        _get(item, "number", int), _get(item, "source", str), _get(item, "level", str), _get(item, "trigger", str),
        _get(item, "kind", str), float(_get(item, "rating", (int, float))), _get(item, "since", int), reason,
    )


def _optional(data: Any, key: str) -> Candidate | None:
    item = _get(data, key, object)
    return None if item is None else _candidate(item)


def _texts(data: Any, key: str) -> tuple[str, ...]:
    items = _get(data, key, list)
    if not all(isinstance(item, str) for item in items):
        raise ValueError(f"{key}: expected texts, got {items!r}")
    return tuple(items)


def _get(data: Any, key: str, kind: type | tuple[type, ...]) -> Any:
    if not isinstance(data, dict):
        raise ValueError(f"expected an object with the key {key!r}, got {type(data).__name__}")
    if key not in data:
        raise ValueError(f"expected the key {key!r}, got keys {', '.join(data) or 'none'}")
    value = data[key]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not object):
        names = " or ".join(k.__name__ for k in (kind if isinstance(kind, tuple) else (kind,)))
        raise ValueError(f"{key}: expected {names}, got {type(value).__name__}")
    return value
