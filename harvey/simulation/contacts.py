"""Contacts: where the robot truly touched something. Only the referee and the recording hear of it."""

from __future__ import annotations

from dataclasses import dataclass

from sim.body.simulated_body import SimulatedBody
from sim.truth import Truth
from world_models.building.world import World
from world_models.entries import Place


@dataclass(frozen=True, slots=True)
class TrueContact:
    """Where the robot truly was, and how fast it moved, when it touched something."""

    place: Place
    speed_m_per_s: float


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
            contact = TrueContact(self._place(truth), truth.contact_m_per_s)
            found += [contact] * (truth.collisions - self._counted)
            self._counted = truth.collisions
        self._followed = len(track)
        return tuple(found)

    def _place(self, truth: Truth) -> Place:
        pose = truth.world_from_robot
        if not truth.locale:
            return Place("", pose.x_m, pose.y_m)
        return Place.of_world(self._world, truth.locale, pose.x_m, pose.y_m)
