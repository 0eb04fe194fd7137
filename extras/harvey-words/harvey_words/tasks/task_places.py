"""Where the words of a task lead in a building: rooms by name, kind or owner, and where things are kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches

from harvey_words.tasks.task_entries import Step
from harvey_words.tasks.task_words import HOME, START, TaskWordsError, task_lexicon
from harvey_words.tasks.told_way import list_rooms, read_way
from world_models.building.world import words_of
from world_models.commands import find_open_point
from world_models.entries import Place
from world_models.frame_building import FrameBuilding
from world_models.words import listed

MOST_SEARCHED = 200  # rooms that are searched for a thing
ALIKE = 0.8  # a word so like one of a room's name, and the only one, is taken to be misspelt


def find_places(building: FrameBuilding, wanted: Sequence[Step], start: Place) -> list[Step]:
    """The steps with their places, those of a way each with its own. Raises as :func:`find_place` does."""
    found, stand = list[Step](), replace(start, heading_rad=None)
    for step in wanted:
        if step.is_told:
            here = next((one.place for one in reversed(found) if one.place is not None), start)
            found += read_way(building, step.phrase, here)
        else:
            place = find_place(building, step, step.phrase, stand) if step.phrase else None
            found.append(replace(step, place=place))
    return [replace(step, instead=find_place(building, step, step.other, stand) if step.other else None)
            for step in found]


def find_place(building: FrameBuilding, step: Step, phrase: str, start: Place) -> Place:
    """The place that a phrase of a step means.

    Raises TaskWordsError where not one room answers, naming the phrase and what is near; MissingEntryError.
    """
    if phrase == START:
        return start
    room = _find_home(building, step.what) if phrase == HOME else _find_room(building, phrase)
    return find_open_point(building, room)


def _find_room(building: FrameBuilding, phrase: str) -> str:
    """The room that answers to a phrase, also where a word of it is misspelt."""
    try:
        return building.find_rooms((phrase,))[0]
    except ValueError as error:
        known = sorted({word for name in list_rooms(building, building.root) for word in words_of(name)})
        near = [get_close_matches(word, known, 2, ALIKE) for word in phrase.split()]
        spelt = (one[0] if len(one) == 1 else word for word, one in zip(phrase.split(), near, strict=True))
        if (better := " ".join(spelt)) == phrase:
            raise TaskWordsError(str(error)) from None
        return _find_room(building, better)


def _find_home(building: FrameBuilding, what: str) -> str:
    """The room where the model says that a thing is: one of that name first, then where such things are kept."""
    word, rooms, kept = what.split()[-1], list(list_rooms(building, building.root)), task_lexicon()["HOMES"]
    for home in (word, *kept.get(word, kept.get(word.rstrip("s"), ()))):
        named = [room for room in rooms if home != word and words_of(home) <= words_of(room)]
        found = Counter(named) or _count_things(building, rooms[:MOST_SEARCHED], home)
        best = [room for room, number in sorted(found.items()) if number == max(found.values())]
        if len(best) > 1:
            raise TaskWordsError(f"expected from where to take {what!r}, as it may be in {listed(best)}")
        if best:
            return best[0]
    raise TaskWordsError(f"expected from where to take {what!r}, as 'fetch it from ROOM': {building.root} does not say")


def _count_things(building: FrameBuilding, rooms: list[str], home: str) -> Counter[str]:
    """How many things of some words each room has."""
    building.require(rooms)
    return Counter(room for room in rooms for thing in building.things_of(room)
                   if words_of(home) <= words_of(f"{thing.name} {thing.kind}"))
