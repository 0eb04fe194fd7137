"""What it met that was otherwise than known: contacts, faults, doors, things in the way, its own camera."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from harvey.story.parts import Section, Sentence, sentence_of
from harvey.story.turns import read_collisions
from harvey.why.history import History
from harvey.why.sentences import value_of
from logs.turning_points import TurningPoint
from world_models.camera_lessons import find_camera_lessons
from world_models.entries.robot import CameraState


def tell_contacts(history: History, turns: tuple[TurningPoint, ...], result: Mapping[str, Any]) -> Section:
    """What it felt; and, where the simulator says so, what it truly touched."""
    felt = tuple(_sentences(turns, "contact"))
    truly = tuple(
        Sentence(f"It truly touched something at {point.text}.", point.cycle, point.time_s)
        for point in read_collisions(history, result)
    )
    nothing = (Sentence("It felt no contact."),)
    unknown = (
        ""
        if "collisions" in result and result["collisions"] is not None
        else ("What it touched without feeling it nobody recorded: there is no result of the simulator.")
    )
    missing = (result.get("collisions") or 0) - len(truly)
    more = f"The simulator counts {missing} more, and does not say where." if missing > 0 else unknown
    return Section("What it touched", (*(felt or nothing), *truly, *((Sentence(more),) if more else ())))


def tell_things(turns: tuple[TurningPoint, ...]) -> Section:
    """Doors found shut, things in the way, and what became of them; faults of its body."""
    found = tuple(point for point in turns if point.kind in ("door", "thing", "fault", "resumed"))
    told = tuple(Sentence(f"{point.text[:1].upper()}{point.text[1:]}.", point.cycle, point.time_s) for point in found)
    return Section(
        "Doors, things in the way and faults",
        told or (Sentence("No door was found otherwise than known, nothing stood in the way, and nothing failed."),),
    )


def tell_camera(history: History) -> Section:
    """What has turned out to be otherwise about the camera than told: each since when it was so to the end."""
    records = list(history.of_kind("CameraState"))
    states = [value_of(record, CameraState) for record in records]
    lessons = [find_camera_lessons(states[0], state) for state in states]
    told: list[Sentence] = []
    for lesson in lessons[-1] if lessons else ():
        since = next(
            i for i, _ in enumerate(lessons) if all(lesson.what in (one.what for one in later) for later in lessons[i:])
        )
        told.append(sentence_of(history, f"The {lesson.text()}; known since then.", records[since], records[-1]))
    return Section("The camera", tuple(told) or (Sentence("The camera was found to be as told."),))


def _sentences(turns: tuple[TurningPoint, ...], kind: str) -> Iterator[Sentence]:
    for point in turns:
        if point.kind == kind:
            yield Sentence(f"{point.text[:1].upper()}{point.text[1:]}.", point.cycle, point.time_s)
