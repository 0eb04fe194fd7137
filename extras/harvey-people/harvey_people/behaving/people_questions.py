"""Questions about people, of a run: why did it wait, and who was in the way?"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from harvey_people.behaving.people_entries import PeoplePass, PeopleWait
from logs.explain.phrases import Sentence, Story, describe_decision, moment, sentence
from logs.explain.questions_in_words import Asked, Known
from logs.records import EntryRecord
from logs.timeline import Timeline
from world_models.words import count

MOST = 6
"""Most waits and people that are told, the newest."""
Record = EntryRecord[Any]


def find_questions(history: Timeline) -> Mapping[str, Known]:
    """Those that a run answers: none where it met nobody."""
    met = [*history.of_kind(PeopleWait), *history.of_kind(PeoplePass)]
    return QUESTIONS if met else {}


def _tell_waits(asked: Asked) -> Iterator[Story]:
    """Each wait for people: whom it waited for, how long, and how it ended."""
    ended = {record.id: record for record in asked.history.of_kind(PeopleWait, until=asked.at)}
    if not ended:
        yield Story("It waited for nobody.")
    for last in list(ended.values())[-MOST:]:
        first = next(record for record in asked.history.of_kind(PeopleWait) if record.id == last.id)
        head = f"In {moment(asked.history, first.cycle)} it waited for {first.value.who}: {first.value.where}."
        steps = (Sentence(f"The risk of a touch was {first.value.p:.1%}.", (first.ref, *first.because), label="risk"),
                 Sentence(f"In cycle {last.cycle}: {sentence(last)}.", (last.ref, *last.because), label="end"))
        yield Story(head, steps, last.ref, describe_decision(asked.history, last))


def _tell_people(asked: Asked) -> Iterator[Story]:
    """Each of those for whom it waited, or whom it passed."""
    met: dict[str, list[Record]] = {}
    waited: list[Record] = [*asked.history.of_kind(PeopleWait, until=asked.at)]
    for record in (*waited, *asked.history.of_kind(PeoplePass, until=asked.at)):
        met.setdefault(record.value.who, []).append(record)
    if not met:
        yield Story("Nobody was in the way.")
    for who, records in sorted(met.items(), key=lambda one: one[1][-1].cycle)[-MOST:]:
        first = min(records, key=lambda record: record.cycle)
        waits = len({record.id for record in records if record.kind is PeopleWait})
        passes = sum(record.kind is PeoplePass for record in records)
        what = " and ".join([f"it waited {count(waits, 'time')}"] * bool(waits)
                            + [f"it passed in {count(passes, 'move')}"] * bool(passes))
        last = max(records, key=lambda record: record.cycle)
        yield Story(f"{who}, first in {moment(asked.history, first.cycle)}: {first.value.where}; for that {what}.",
                    (Sentence(f"In cycle {last.cycle}: {sentence(last)}.", (last.ref, *last.because), label="met"),),
                    last.ref, describe_decision(asked.history, last))


def _known(words: str, answer: Callable[[Asked], Iterator[Story]]) -> Known:
    return frozenset(words.split()), answer


QUESTIONS: Mapping[str, Known] = {
    "why did it wait?": _known("wait waited waits waiting", _tell_waits),
    "who was in the way?": _known("who whom whose people person persons", _tell_people),
}
"""As somebody may ask."""
