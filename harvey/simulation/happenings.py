"""Happenings: true contacts, injected faults, changes of the building. Referee and recording alone hear of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from sim.body.collision import Obstacles
from sim.body.simulated_body import SimulatedBody
from sim.ground_truth.things import MovedThing
from sim.truth import Truth
from world_models.building.geometry.faces import Face
from world_models.building.world import World
from world_models.entries import Place

LEAF = "true-leaf"
"""The part of a face's name by which a door's leaf is known."""


@dataclass(frozen=True, slots=True)
class TrueContact:
    """Where the robot truly was, how fast it moved, and what was nearest to it, when it touched something."""

    place: Place
    speed_m_per_s: float
    thing: str


class ContactWatch:
    """Finds the contacts since it was asked last."""

    def __init__(self, world: World, body: SimulatedBody) -> None:
        self._world, self._body = world, body
        self._counted = self._followed = 0

    def new_contacts(self) -> tuple[TrueContact, ...]:
        """Each time that the robot truly touched something, oldest first."""
        if self._body.truth.collisions == self._counted:
            return ()
        track = self._body.track
        found: list[TrueContact] = []
        for truth in (*track[self._followed:], self._body.truth):
            if truth.collisions > self._counted:
                contact = TrueContact(self._place(truth), truth.contact_m_per_s, self._find_nearest(truth))
                found += [contact] * (truth.collisions - self._counted)
            self._counted = truth.collisions
        self._followed = len(track)
        return tuple(found)

    def _place(self, truth: Truth) -> Place:
        pose = truth.world_from_robot
        if not truth.locale:
            return Place("", pose.x_m, pose.y_m)
        return Place.of_world(self._world, truth.locale, pose.x_m, pose.y_m)

    def _find_nearest(self, truth: Truth) -> str:
        """The thing, wall or door whose faces are nearest to the robot; "" outside all locales."""
        faces = [*self._world.faces_within(truth.locale), *self._body.building.added] if truth.locale else []
        parts = {name: [face for face in faces if _names([face]) == {name}] for name in _names(faces)}
        clearances_m = {name: Obstacles.of_faces(part, self._body.building.floor_m).clearance_m(truth.world_from_robot)
                        for name, part in parts.items()}
        return min(sorted(clearances_m), key=lambda name: clearances_m[name], default="")


class HappeningWatch:
    """Finds what happened since it was asked last; first how the building differs from the robot's model."""

    def __init__(self, body: SimulatedBody, moved: Iterable[MovedThing] = ()) -> None:
        self._body, self._reported = body, 0
        self._moved = tuple(f"the thing {one.thing} stands elsewhere than in the model" for one in moved)
        self._added, self._gone = frozenset[str](), frozenset[str]()

    def new_happenings(self) -> tuple[str, ...]:
        """Each in words, oldest first."""
        moved, self._moved = self._moved, ()
        happened = self._body.happened[self._reported:]
        self._reported += len(happened)
        return (*moved, *self._find_changes(), *happened)

    def _find_changes(self) -> Iterator[str]:
        building = self._body.building
        added, gone = _names(building.added), _names(building.gone)
        was_added, was_gone, self._added, self._gone = self._added, self._gone, added, gone
        for name in sorted(added - was_added):
            stands = "is there, and the model lacks it"
            yield _describe(name, "is not as open as the model has it" if name.endswith(LEAF) else stands)
        for name in sorted(was_added - added):
            yield _describe(name, "is open again" if name.endswith(LEAF) else "is taken away again")
        yield from (f"the thing {name} is not there, and the model has it" for name in sorted(gone - was_gone - added))
        yield from (f"the thing {name} is there again" for name in sorted(was_gone - gone - was_added))


def _describe(name: str, what: str) -> str:
    return f"the door {name.partition('/')[0]} {what}" if name.endswith(LEAF) else f"the thing {name} {what}"


def _names(faces: Iterable[Face]) -> frozenset[str]:
    """Names of the things and doors whose faces these are."""
    return frozenset("/".join(face.name.split("/")[:2]) for face in faces)
