"""Why: from an entry down to what it rests on, as a walk through the journal."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import fill

from harvey.diff.first_difference import differing_leaves
from harvey.run_files.records import DecisionRecord, EntryRecord
from harvey.why.decisions import describe_decision
from harvey.why.history import History
from harvey.why.sentences import sentence
from world_models.words import count

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
    """The walk in plain sentences, indented.

    Raises:
        BadInput: a reason is missing, and so is a line of the journal, or a part of one.
    """
    reasons = list(walk(history, refs, depth))
    if any(reason.record is None for reason in reasons):
        history.verify()
    for index, reason in enumerate(reasons):
        if reason.depth == 0 and reason.record is not None:
            yield from ["", _who(reason.record, history)] if index else [_who(reason.record, history)]
        leads_on = index + 1 < len(reasons) and reasons[index + 1].depth > reason.depth
        yield _wrap(reason.depth, _describe(reason) + (", because" if leads_on else ""))
    if any(reason.hidden for reason in reasons):
        yield f"(--depth {depth + 1} goes on where it says \"and so on\")"


def _wrap(depth: int, text: str) -> str:
    indent = "  " * min(depth, DEEPEST_INDENT)
    return fill(text, WIDTH, initial_indent=indent, subsequent_indent=indent + "    ", break_on_hyphens=False)


def _describe(reason: Reason) -> str:
    if reason.known:
        return f"{reason.ref}, as {reason.known}"
    if reason.record is None:
        return f"{reason.ref}, of which the journal says nothing"
    tail = f" (and so on: {count(reason.hidden, 'reason')} below)" if reason.hidden else ""
    return f"{reason.ref}: {_describe_record(reason.record, reason.after)}{tail}"


def _describe_record(record: EntryRecord, after: EntryRecord | None) -> str:
    """The sentence; of an earlier revision of what rests on it, only what little was different, if it was little."""
    if after is not None and after.id == record.id:
        changed = list(differing_leaves(record.value, after.value))
        if 0 < len(changed) <= FEW:
            return "before that, " + ", ".join(f"{path} = {then}" for path, then, _ in changed)
    return sentence(record)


def _who(record: EntryRecord, history: History) -> str:
    return fill(f"{record.ref}: {describe_decision(history, record)}", WIDTH, break_on_hyphens=False)


PRINCIPAL = (
    "Outcome", "MotorCommand", "Goal", "PlanSketch", "Recovery", "Hypothesis", "Certificate", "Milestone", "Leg",
    "Look",
)
"""Of what one act makes, the first of these is what it was done for."""


def _rank(record: EntryRecord) -> int:
    """A smaller number for what an act was rather done for; that it found out where it is comes before its new goal."""
    value = record.value if isinstance(record.value, dict) else {}
    if record.type == "Hypothesis" and value.get("basis") == "relocalization" and value.get("status") == "held":
        return 0
    return 1 + (PRINCIPAL.index(record.type) if record.type in PRINCIPAL else len(PRINCIPAL))


def find_refs(history: History, what: str | int | None) -> list[str]:
    """The entries that explain an entry (by name), a cycle (by number), or the outcome (None). Raises BadInput."""
    if isinstance(what, int):
        return principal(history.decision(what))
    return [history.resolve(what) if what else history.outcome()]


def principal(decision: DecisionRecord) -> list[str]:
    """What to explain of a decision: the chief entry that it made, or what woke those who made nothing."""
    made = sorted(decision.made, key=_rank)
    if made:
        return [made[0].ref]
    if decision.chosen is not None:
        return [decision.chosen.trigger]
    return list(decision.seen[:1])
