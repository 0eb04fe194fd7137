"""History: the decisions of a board, kept. It tells why, it is saved and read, decided again, compared with another.

A line of a history is a line of the journal (:mod:`blackboard.journal`): the same decisions give the same bytes.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from blackboard.decoding import decode
from blackboard.effect import Effect, Post, Retract, Revise
from blackboard.entry import Ref
from blackboard.journal import Decision, decision_line
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import Scheduler

Record = Mapping[str, Any]


class History:
    """The decisions of one run. While it runs, a sink of its scheduler: ``Scheduler(sources, sinks=[history])``."""

    def __init__(self, lines: Iterable[str] = ()) -> None:
        """``lines``: of a journal, without their newlines. Raises ValueError for one that is no decision."""
        self.lines: list[str] = []
        self._changes: dict[str, Record] = {}
        for number, line in enumerate(lines, 1):
            try:
                self._note(line)
            except (ValueError, TypeError, KeyError):
                raise ValueError(f"line {number}: expected a decision, got {line[:80]!r}") from None

    @classmethod
    def of(
        cls, sources: Sequence[KnowledgeSource], kinds: Iterable[type[Any]] = (), /, **outside: Iterable[Any]
    ) -> History:
        """What sources make of values from outside, each by who tells it; ``kinds``: as for a scheduler."""
        history = cls()
        scheduler = Scheduler(sources, sinks=[history], kinds=kinds)
        for author, told in outside.items():
            scheduler.post(map(Post, told), author)
        scheduler.run()
        return history

    def __call__(self, decision: Decision) -> None:
        self._note(decision_line(decision))

    def save(self, path: Path | str) -> None:
        """Write it as a journal. Raises OSError."""
        Path(path).write_text("".join(f"{line}\n" for line in self.lines), encoding="utf-8")

    @classmethod
    def read(cls, path: Path | str) -> History:
        """A history from a journal. Raises OSError, and ValueError for a line that is no decision."""
        return cls(Path(path).read_text(encoding="utf-8").splitlines())

    def why(self, name: str) -> str:
        """What an entry is because of, down to what came from outside; each entry is listed once.

        Args:
            name: ``Word-3``, or ``Word-3.1`` for a revision that is not the last.

        Raises:
            KeyError: the run has no such entry; names those that it has.
        """
        ref = name if name in self._changes else next(
            (ref for ref in reversed(self._changes) if ref.rpartition(".")[0] == name), None)
        if ref is None:
            raise KeyError(f"expected one of {', '.join(self._changes) or 'no entries'}, got {name}")
        return "\n".join(self._tell(ref, 0, set()))

    def replay(self, scheduler: Scheduler) -> int | None:
        """Decide it again, from what came from outside alone; the first cycle that comes out differently, or None.

        Args:
            scheduler: a new one, with the same sources and without ports: what they answered is in the history.

        Raises:
            ValueError: what came from outside is not of a kind that the scheduler's sources know.
        """
        for cycle, line in enumerate(self.lines, 1):
            for record in json.loads(line)["observed"]:
                scheduler.post([_effect_of(record, scheduler)], record["author"])
            decision = scheduler.step()
            if decision is None or decision_line(decision) != line:
                return cycle
        return None

    def to_dot(self) -> str:
        """Who woke whom, by which kind of entry and how often: a graph for Graphviz (``dot -Tsvg``)."""
        woke = Counter[tuple[str, str, str]]()
        for line in self.lines:
            if chosen := json.loads(line)["chosen"]:
                by = self._changes[chosen["trigger"]]
                woke[by["author"], chosen["source"], by["type"]] += 1
        edges = (f'  "{one}" -> "{other}" [label="{kind} x {times}"]' for (one, other, kind), times in woke.items())
        return "\n".join(("digraph {", *edges, "}"))

    def parts_from(self, other: History) -> str:
        """The first cycle in which two runs differ, and in what, in words; "" where they are the same."""
        for cycle, (one, two) in enumerate(zip_longest(self.lines, other.lines), 1):
            if one == two:
                continue
            if one is None or two is None:
                return f"cycle {cycle}: the {'first' if one is None else 'second'} run has ended"
            first, second = json.loads(one), json.loads(two)
            key = next(key for key in {**first, **second} if first.get(key) != second.get(key))
            ours, theirs = _brief(first.get(key)), _brief(second.get(key))
            return f"cycle {cycle}: {key} is {ours} in the first run, {theirs} in the second"
        return ""

    def _note(self, line: str) -> None:
        decision = json.loads(line)
        for whence, key in (("from", "observed"), ("by", "made")):
            self._changes |= {record["entry"]: {**record, "cycle": decision["cycle"], "whence": whence}
                              for record in decision[key] if record["change"] != "Retracted"}
        self.lines.append(line)

    def _tell(self, ref: str, depth: int, seen: set[str]) -> Iterator[str]:
        record, indent = self._changes.get(ref), "  " * depth
        if record is None:
            yield f"{indent}{ref}"
            return
        whence = f"{record['whence']} {record['author']}, cycle {record['cycle']}"
        yield f"{indent}{ref}: {_brief(record['value'])} ({whence})"
        for below in record["because"]:
            if below in seen:
                yield f"{indent}  {below}: see above"
            else:
                seen.add(below)
                yield from self._tell(below, depth + 1, seen)


def _effect_of(record: Record, scheduler: Scheduler) -> Effect:
    """The effect behind a change that came from outside. Raises ValueError."""
    kinds = scheduler.kinds
    if record["type"] not in kinds:
        raise ValueError(f"{record['entry']}: expected one of {', '.join(kinds)}, got a {record['type']}")
    because = tuple(_ref(text) for text in record["because"])
    if record["change"] == "Posted":
        return Post(decode(record["value"], kinds[record["type"]]), because)
    entry = scheduler.view[_ref(record["entry"]).id]
    if record["change"] == "Retracted":
        return Retract(entry, tuple(_ref(text) for text in record.get("retracted_because", ())))
    return Revise(entry, decode(record["value"], kinds[record["type"]]), because)


def _ref(text: str) -> Ref:
    id, _, revision = text.rpartition(".")
    return Ref(id, int(revision))


def _brief(value: Any) -> str:
    """A value in one line; an object by its fields."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {json.dumps(one)}" for name, one in value.items())
    text = json.dumps(value)
    return text if len(text) < 300 else text[:297] + "..."
