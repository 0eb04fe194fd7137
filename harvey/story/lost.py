"""Lost and found: when it was lost, where it believed to be, why, how it looked for itself, and where it was."""

from __future__ import annotations

from collections.abc import Iterator

from blackboard.level import Level
from blackboard.servoing import Discrepancy
from harvey.run_files.records import EntryRecord
from harvey.story.parts import Section, Sentence, sentence_of
from harvey.why import facts
from harvey.why.decisions import time_at
from harvey.why.history import History
from harvey.why.links import nearest, within
from harvey.why.sentences import value_of
from world_models.entries.body import Look
from world_models.entries.location import Hypothesis
from world_models.entries.task import Certificate
from world_models.words import count, listed, metres

MOST_PLACES = 4
"""So many places that came into question are told, the newest."""


def tell_lost(history: History) -> Section:
    """Each time that it was lost."""
    told: list[Sentence] = []
    lost = [record for record in history.of_kind("Discrepancy") if is_lost(record)]
    found = [record for record in history.of_kind("Hypothesis") if is_found(record)]
    for record in lost:
        until = next((one for one in found if one.cycle >= record.cycle), None)
        told += sorted(_tell(history, record, until), key=lambda one: one.cycle or 0)
    return Section("Lost and found", tuple(told) or (Sentence("It was never lost."),))


def is_lost(record: EntryRecord) -> bool:
    """Whether with it the robot no longer knew where it was: nobody below the goal level could correct it."""
    if record.change == "Retracted" or record.value.get("status") != "escalated":
        return False
    return value_of(record, Discrepancy).level.above is Level.GOAL


def is_found(record: EntryRecord) -> bool:
    """Whether with it the robot knew where it was again."""
    if record.change == "Retracted" or record.value.get("basis") != "relocalization":
        return False
    return value_of(record, Hypothesis).is_held


def _tell(history: History, lost: EntryRecord, found: EntryRecord | None) -> Iterator[Sentence]:
    below = nearest(history, lost, ("Hypothesis",))
    where = "" if below is None else f" It believed that it stood at {facts.pose(value_of(below, Hypothesis))}."
    yield sentence_of(history, f"It was lost: {value_of(lost, Discrepancy).what}.{where}", lost, below)
    yield from _tell_reasons(history, lost)
    yield from _tell_search(history, lost, found)
    if found is None:
        yield Sentence("It did not find out where it was.", history.cycles[-1], time_at(history, history.cycles[-1]))
        return
    now = value_of(found, Hypothesis)
    how = f": {now.evidence}" if now.evidence else ""
    yield sentence_of(
        history,
        f"It found out where it was, {_after(history, lost, found)}: at {facts.pose(now)}{_apart(below, now)}{how}.",
        found,
    )


def _tell_reasons(history: History, lost: EntryRecord) -> Iterator[Sentence]:
    """The verdict that it was lost by, and with what the doubt had begun."""
    certificate = nearest(history, lost, ("Certificate",))
    if certificate is not None:
        yield sentence_of(history, f"{_verdict(value_of(certificate, Certificate))}.", certificate)
    what = value_of(lost, Discrepancy).what
    for record in within(history, lost):
        if record.type == "Discrepancy" and value_of(record, Discrepancy).what != what:
            first = _first(history, record)
            yield sentence_of(history, f"It began to doubt: {value_of(record, Discrepancy).what}.", first)
            return


def _verdict(certificate: Certificate) -> str:
    return f"The last verdict on a milestone was {certificate.verdict}: {certificate.reason}"


def _first(history: History, record: EntryRecord) -> EntryRecord:
    return history.entry(f"{record.id}.0") or record


def _tell_search(history: History, lost: EntryRecord, found: EntryRecord | None) -> Iterator[Sentence]:
    """How many pictures it took to find itself, and which places came into question."""
    last = found.cycle if found is not None else history.cycles[-1]
    looks = [
        record
        for record in history.of_kind("Look", until=last)
        if record.cycle >= lost.cycle and value_of(record, Look).purpose == "probe"
    ]
    candidates = {
        record.id: record
        for record in history.of_kind("Hypothesis", until=last)
        if record.cycle >= lost.cycle and record.change == "Posted" and record.value["status"] == "candidate"
    }
    if not looks and not candidates:
        return
    text = f"To find out where it was it took {count(len(looks), 'picture')}"
    if candidates:
        places = [
            f"{value_of(record, Hypothesis).place()} ({value_of(record, Hypothesis).weight:.0%})"
            for record in candidates.values()
        ]
        text += f"; it may have stood at {listed(places, MOST_PLACES)}"
    first = min((*looks, *candidates.values()), key=lambda record: record.cycle)
    yield sentence_of(history, f"{text}.", first, *candidates.values())


def _after(history: History, lost: EntryRecord, found: EntryRecord) -> str:
    text = f"{count(found.cycle - lost.cycle, 'cycle')} later"
    then, now = time_at(history, lost.cycle), time_at(history, found.cycle)
    return text if then is None or now is None else f"{text}, after {now - then:.1f} s"


def _apart(believed: EntryRecord | None, now: Hypothesis) -> str:
    """How far that is from where it had believed to be, where both are in one frame."""
    if believed is None:
        return ""
    before = value_of(believed, Hypothesis)
    if before.locale != now.locale:
        return f", and not in {before.locale}"
    return f", {metres(now.locale_from_robot.distance_to(before.locale_from_robot))} from where it had believed"
