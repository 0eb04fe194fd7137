"""The whole web of reasons: a run cycle by cycle, an entry with all that it rests on, and whether every decision rests
on something: a goal, the model or what the camera saw."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TextIO

from blackboard import Sink, decision_record
from logs.explain.diff import differing_leaves
from logs.explain.phrases import describe_decision, sentence, wrap
from logs.records import Candidate, DecisionRecord, EntryRecord, decision_of
from logs.timeline import Timeline
from world_models.entries import Hypothesis
from world_models.words import count

DEEPEST_INDENT, FEW = 20, 2
DEPTH = 5
"""How many steps down the walk goes unless told otherwise."""
PRINCIPAL = ("Outcome", "MotorCommand", "Goal", "PlanSketch", "Recovery", "Hypothesis", "Certificate", "Milestone",
             "Leg", "PictureRequest")
"""Of what one act makes, the first of these is what it was done for."""
GOAL, MODEL, SENSOR = "goal", "model", "sensor"
KINDS = (GOAL, MODEL, SENSOR)
"""What an explanation may end in: what was asked for, what is known of building and robot, what the camera saw."""
GROUNDS: Mapping[str, str] = {
    "Command": GOAL, "Goal": GOAL, "CameraPicture": SENSOR,
    **dict.fromkeys(("LocaleFrame", "CameraState", "Wheels", "Footprint", "UserReport", "Redirection"), MODEL)}
"""The kinds of entries that are such an end themselves; what the robot is told of the model is a part of it."""
NAMING: Mapping[str, str] = {"Milestone": "landmarks", "Tracks": "items", "PlanSketch": "subgoals"}
"""The fields by which others name what is in the model."""
Ends = frozenset[str]
"""What some entry ends in: some of KINDS, and the names of the reasons of which the journal says nothing."""


def printing(out: TextIO) -> Sink:
    """A sink that prints every cycle in a line."""
    return lambda decision: print(cycle_line(decision_of(decision_record(decision))), file=out)


MAX_LINE = 160


def cycle_line(decision: DecisionRecord) -> str:
    """One cycle in a line: who acted, woken by what, and what came of it."""
    outside = f"{', '.join(change.ref for change in decision.observed)} came; " if decision.observed else ""
    who = "nobody acts" if decision.chosen is None else f"{decision.chosen.source} on {decision.chosen.trigger}"
    made = ", ".join(f"{change.change.lower()} {change.ref}" for change in decision.made)
    line = f"{decision.cycle:5}  {decision.focus:<6}  {outside}{who}{': ' if made else ''}{made}"
    line += " (refused)" if decision.refused else ""
    return line if len(line) <= MAX_LINE else f"{line[:MAX_LINE - 4]} ..."


def cycle_lines(decision: DecisionRecord, candidates: Iterable[Candidate]) -> Iterator[str]:
    """One cycle; the candidates are those among which was chosen."""
    yield f"cycle {decision.cycle}, focus {decision.focus}"
    yield from (_change_line("observed", change) for change in decision.observed)
    outside = {change.ref for change in decision.observed}
    if inside := [ref for ref in decision.seen if ref not in outside]:
        yield f"  sees      {', '.join(inside)}"
    yield from (f"  drops     {_activation(c)}: {c.reason}" for c in decision.obviated)
    first, second = (c and c.number for c in (decision.chosen, decision.runner_up))
    for c in candidates:
        word = "chooses" if c.number == first else "next" if c.number == second else "pending"
        yield f"  {word:<9} {_activation(c)}, rated {c.rating:.2f}"
    yield from (_change_line(change.change.lower(), change) for change in decision.made)
    if decision.refused:
        yield f"  refused   {decision.refused.rstrip().splitlines()[-1]}"


def _activation(c: Candidate) -> str:
    return f"{c.source} ({c.level}) on {c.trigger}"


def _change_line(word: str, change: EntryRecord[Any]) -> str:
    return f"  {word:<9} {change.ref} by {change.author}: {sentence(change)}"


def walk(history: Timeline, refs: Sequence[str], depth: int = DEPTH) -> Iterator[tuple[int, str, str]]:
    """Each entry, then what it rests on, depth first; what is shared is told once, nearest to what is explained.

    Returns:
        steps down, ref, sentence; of an earlier revision of what rests on it only what little was different.
    """
    shown, nearest = set[str](), _distances(history, refs, depth)
    stack: list[tuple[int, str, EntryRecord[Any] | None]] = [(0, ref, None) for ref in reversed(refs)]
    while stack:
        level, name, after = stack.pop()
        record = history.entry(name)
        if name in shown or nearest[name] < level:
            yield level, name, f"{name}, as {'above' if name in shown else 'below'}"
        elif record is None:
            yield level, name, f"{name}, of which the journal says nothing"
        else:
            shown.add(name)
            is_revised = after is not None and after.id == record.id
            before = list(differing_leaves(record.fields, after.fields)) if after is not None and is_revised else []
            text = f"{name}: {sentence(record)}" if not 0 < len(before) <= FEW else (
                f"{name}: before that, {', '.join(f'{path} = {then}' for path, then, _ in before)}")
            if level < depth:
                stack += [(level + 1, reason, record) for reason in reversed(record.because)]
                yield level, name, text + ", because" * bool(record.because)
            else:
                tail = f" (and so on: {count(len(record.because), 'reason')} below)"
                yield level, name, text + tail * bool(record.because)


def _distances(history: Timeline, refs: Sequence[str], depth: int) -> dict[str, int]:
    """The fewest steps from what is explained to each entry that is at most ``depth`` steps away."""
    nearest, layer = dict.fromkeys(refs, 0), list(refs)
    for steps in range(1, depth + 1):
        records = [record for ref in layer if (record := history.entry(ref)) is not None]
        layer = [*dict.fromkeys(ref for record in records for ref in record.because if ref not in nearest)]
        nearest |= dict.fromkeys(layer, steps)
        if not layer:
            break
    return nearest


def explain(history: Timeline, refs: Sequence[str], depth: int = DEPTH) -> Iterator[str]:
    """The walk in plain sentences, indented.

    Raises BadInput where a reason is missing, and so is a line of the journal, or a part of one.
    """
    reasons = list(walk(history, refs, depth))
    if any(history.entry(ref) is None for _, ref, _ in reasons):
        history.verify()
    for number, (level, ref, text) in enumerate(reasons):
        record = history.entry(ref)
        if level == 0 and record is not None:
            yield from [""] * (number > 0)
            yield wrap(f"{ref}: {describe_decision(history, record)}")
        indent = "  " * min(level, DEEPEST_INDENT)
        yield wrap(text, indent, indent + "    ")
    if any(text.endswith(" below)") for _, _, text in reasons):
        yield f"(--depth {depth + 1} goes on where it says \"and so on\")"


def find_refs(history: Timeline, what: str | int | None) -> list[str]:
    """The entries that explain an entry (by name), a cycle (by number), or the outcome (None). Raises BadInput.

    Of a cycle that is the chief entry that it made, or what woke those who made nothing.
    """
    if not isinstance(what, int):
        return [history.resolve(what) if what else history.outcome()]
    decision = history.decision(what)
    if decision.made:
        return [min(decision.made, key=_rank).ref]
    return [decision.chosen.trigger] if decision.chosen is not None else list(decision.seen[:1])


def _rank(record: EntryRecord[Any]) -> int:
    """A smaller number for what an act was rather done for; that it found out where it is comes before its new goal."""
    if record.kind is Hypothesis and (record.field("basis"), record.field("status")) == ("relocalization", "held"):
        return 0
    return 1 + (PRINCIPAL.index(record.type) if record.type in PRINCIPAL else len(PRINCIPAL))


def kind_of(record: EntryRecord[Any]) -> str | None:
    """The kind of ground that an entry is itself; None where it is none."""
    names_the_model = record.type in NAMING and record.field(NAMING[record.type])
    return MODEL if names_the_model else GROUNDS.get(record.type)


def explained_by(decision: DecisionRecord) -> tuple[str, ...]:
    """The entries that a decision is explained by.

    What it made; where it made nothing (it was refused), what woke the knowledge source; where nobody acted, what
    woke those that were dropped. Nothing where nothing was decided.
    """
    if decision.made:
        return tuple(dict.fromkeys(ref for r in decision.made for ref in r.retracted_because or (r.ref,)))
    if decision.chosen is not None:
        return (decision.chosen.trigger,)
    return tuple(dict.fromkeys(c.trigger for c in decision.obviated))


def trace_grounds(
    decisions: Iterable[DecisionRecord], kind_of: Callable[[EntryRecord[Any]], str | None] = kind_of
) -> Iterator[tuple[DecisionRecord, Mapping[str, Ends]]]:
    """Each decision of a run, and in what each of those ends that it is explained by.

    Reasons are older than what rests on them, so one pass does.
    """
    known: dict[str, Ends] = {}
    for decision in decisions:
        for record in decision.changes:
            if not record.is_gone or record.ref not in known:
                own = frozenset(filter(None, [kind_of(record)]))
                known[record.ref] = own.union(*(known.get(ref, Ends([ref])) for ref in record.because))
        yield decision, {ref: known.get(ref, Ends([ref])) for ref in explained_by(decision)}


def holds(ends: Ends) -> bool:
    """Whether there is something at the bottom, and no step of the way is missing."""
    return bool(ends) and ends.issubset(KINDS)


@dataclass(frozen=True, slots=True)
class RestingCount:
    """How many decisions of a run rest on something; so do those in which nothing was decided.

    Attributes:
        decisions: all cycles; acts: those in which somebody was chosen.
        by_kind: how many reach each of KINDS.
        failing: of those that do not, by cycle: the entries below which nothing is.
    """

    decisions: int
    acts: int
    by_kind: Mapping[str, int]
    failing: Mapping[int, Sequence[str]]

    @property
    def reached(self) -> int:
        """How many rest on something."""
        return self.decisions - len(self.failing)


def check(history: Timeline) -> RestingCount:
    """Every decision of a run. Raises BadInput where a line of its journal is malformed."""
    decisions = acts = 0
    by_kind, failing = Counter[str](dict.fromkeys(KINDS, 0)), dict[int, Sequence[str]]()
    for decision, ends in trace_grounds(history.decisions()):
        decisions += 1
        acts += decision.chosen is not None
        by_kind.update(frozenset[str]().union(*ends.values()).intersection(KINDS))
        if lacking := [ref for ref, below in ends.items() if not holds(below)]:
            failing[decision.cycle] = lacking
    return RestingCount(decisions, acts, by_kind, failing)
