"""Why: from an entry down to what it rests on, as a walk through the journal."""

from __future__ import annotations

import difflib
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from textwrap import fill

from harvey.diff import differing_leaves
from harvey.errors import BadInput
from harvey.records import Candidate, DecisionRecord, EntryRecord
from harvey.sentences import sentence
from harvey.units import count

WIDTH = 120
DEEPEST_INDENT = 20
FEW = 2
DEPTH = 5
"""How many steps down the walk goes unless told otherwise."""


@dataclass(frozen=True, slots=True)
class Reason:
    """One line of the explanation.

    Attributes:
        depth: 0 for what is explained.
        ref: of the entry.
        record: what the journal says of it; None where it says nothing.
        after: the entry that rests on it; None for what is explained.
        known: ``above`` or ``below``, where it is told already or, nearer to what is explained, told yet.
        hidden: how many reasons of its own are left out because they lie too deep.
    """

    depth: int
    ref: str
    record: EntryRecord | None
    after: EntryRecord | None = None
    known: str = ""
    hidden: int = 0


class History:
    """Every revision of every entry of a run, and the decision that made it."""

    def __init__(self, decisions: Iterable[DecisionRecord]) -> None:
        """Raises BadInput where a line of the journal is malformed."""
        self._entries: dict[str, EntryRecord] = {}
        self._newest: dict[str, str] = {}
        self._decisions: dict[int, DecisionRecord] = {}
        for decision in decisions:
            self._decisions[decision.cycle] = decision
            for record in (*decision.observed, *decision.made):
                if record.change != "Retracted" or record.ref not in self._entries:
                    self._entries[record.ref] = record
                self._newest[record.id] = record.ref

    def entry(self, ref: str) -> EntryRecord | None:
        return self._entries.get(ref)

    def decision(self, cycle: int) -> DecisionRecord:
        """Raises BadInput where the run has no such cycle."""
        if cycle not in self._decisions:
            have = f"cycles {min(self._decisions)} to {max(self._decisions)}" if self._decisions else "none"
            raise BadInput(f"--at: expected a cycle of the run, which has {have}, got {cycle}")
        return self._decisions[cycle]

    def outcome(self) -> str:
        """Ref of how the mission ended, or, where it did not come to that, of the last entry.

        Raises:
            BadInput: the journal is empty.
        """
        outcomes = [id for id in self._newest if id.startswith("Outcome-")]
        if not self._newest:
            raise BadInput("expected a run with at least one entry in its journal, got none")
        return self._newest[outcomes[-1]] if outcomes else next(reversed(self._entries))

    def named(self, text: str) -> str:
        """The ref that a user means: ``MotorCommand-12.3``, or ``MotorCommand-12`` for its last revision.

        Raises:
            BadInput: the run has no such entry; near ones are named.
        """
        names = {name.lower(): ref for name, ref in self._newest.items()} | {ref.lower(): ref for ref in self._entries}
        if text.lower() in names:
            return names[text.lower()]
        ids = list(self._newest)
        near = difflib.get_close_matches(text, ids, n=4, cutoff=0.6) or [ids[0], ids[-1]] if ids else []
        raise BadInput(f"expected an entry of the run, as {', '.join(near) or 'none'}, got {text!r}")


def walk(history: History, refs: Sequence[str], depth: int = DEPTH) -> Iterator[Reason]:
    """Each entry, then what it rests on, depth first; what is shared is told once, nearest to what is explained."""
    told: set[str] = set()
    nearest = _distances(history, refs, depth)
    stack: list[tuple[int, str, EntryRecord | None]] = [(0, ref, None) for ref in reversed(refs)]
    while stack:
        level, name, after = stack.pop()
        record = history.entry(name)
        known = "above" if name in told else "below" if nearest[name] < level else ""
        if known or record is None:
            yield Reason(level, name, record, after, known)
            continue
        told.add(name)
        hidden = len(record.because) if level >= depth else 0
        yield Reason(level, name, record, after, hidden=hidden)
        if not hidden:
            stack += [(level + 1, reason, record) for reason in reversed(record.because)]


def _distances(history: History, refs: Sequence[str], depth: int) -> dict[str, int]:
    """The fewest steps from what is explained to each entry that is at most ``depth`` steps away."""
    nearest = dict.fromkeys(refs, 0)
    queue = deque(refs)
    while queue:
        name = queue.popleft()
        record = history.entry(name)
        if record is None or nearest[name] >= depth:
            continue
        for reason in record.because:
            if reason not in nearest:
                nearest[reason] = nearest[name] + 1
                queue.append(reason)
    return nearest


def explain(history: History, refs: Sequence[str], depth: int = DEPTH) -> Iterator[str]:
    """The walk in plain sentences, indented."""
    reasons = list(walk(history, refs, depth))
    for index, reason in enumerate(reasons):
        if reason.depth == 0 and reason.record is not None:
            yield from ["", _who(reason.record, history)] if index else [_who(reason.record, history)]
        leads_on = index + 1 < len(reasons) and reasons[index + 1].depth > reason.depth
        yield _wrapped(reason.depth, _told(reason) + (", because" if leads_on else ""))
    if any(reason.hidden for reason in reasons):
        yield f"(--depth {depth + 1} goes on where it says \"and so on\")"


def _wrapped(depth: int, text: str) -> str:
    indent = "  " * min(depth, DEEPEST_INDENT)
    return fill(text, WIDTH, initial_indent=indent, subsequent_indent=indent + "    ", break_on_hyphens=False)


def _told(reason: Reason) -> str:
    if reason.known:
        return f"{reason.ref}, as {reason.known}"
    if reason.record is None:
        return f"{reason.ref}, of which the journal says nothing"
    tail = f" (and so on: {count(reason.hidden, 'reason')} below)" if reason.hidden else ""
    return f"{reason.ref}: {_said(reason.record, reason.after)}{tail}"


def _said(record: EntryRecord, after: EntryRecord | None) -> str:
    """The sentence; of an earlier revision of what rests on it, only what little was different, if it was little."""
    if after is not None and after.id == record.id:
        changed = list(differing_leaves(record.value, after.value))
        if 0 < len(changed) <= FEW:
            return "before that, " + ", ".join(f"{path} = {then}" for path, then, _ in changed)
    return sentence(record)


def _who(record: EntryRecord, history: History) -> str:
    if record.observed:
        return f"{record.ref} came from outside, from {record.author}, and was taken up in cycle {record.cycle}."
    decision = history.decision(record.cycle)
    head = f"{record.ref} was made in cycle {record.cycle} by {record.author}"
    if decision.chosen is None:
        return head + "."
    second = f"; next was {_rated(decision.runner_up)}" if decision.runner_up else "; nothing else was pending"
    return f"{head}, chosen as {_rated(decision.chosen)}, with the {decision.focus} level in focus{second}."


def _rated(c: Candidate) -> str:
    return f"{c.source} ({c.level} level, rated {c.rating:.2f}) on {c.trigger}"
