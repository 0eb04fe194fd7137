"""Where the robot felt to touch something, by its own belief: a mark on its rim that stays."""

from __future__ import annotations

import math

import rerun as rr

from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import BELIEVED
from logs.recording.paths import CONTACTS
from logs.recording.stream import RecordingStream
from world_models import words
from world_models.entries.robot import Footprint
from world_models.entries.touch import Contact
from world_models.frames import Pose2

HEIGHT_M = 0.3
"""Of a bumper above the floor."""


class Contacts(Logger):
    """Logs a mark for each contact."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._belief = subject.belief
        self._places: list[tuple[float, float, float]] = []
        self._labels: list[str] = []

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        contacts = moment.changed(Contact)
        held = self._belief.now(moment.mirror) if contacts else None
        if held is None:
            return
        if not self._places:
            stream.fix(CONTACTS, rr.Points3D.from_fields(colors=[BELIEVED], radii=0.08, show_labels=False))
        footprint = moment.mirror.latest(Footprint)
        for contact in contacts:
            radius_m = 0.0 if footprint is None else footprint.value.radius_m
            self._places.append(place_of(contact.value, held.world_from_robot, radius_m))
            self._labels.append(words.brief(contact.value))
        stream.log(CONTACTS, rr.Points3D, positions=self._places, labels=self._labels)


def place_of(contact: Contact, world_from_robot: Pose2, radius_m: float) -> tuple[float, float, float]:
    """The point of the robot's rim that touched [m, world]."""
    angle = world_from_robot.heading_rad + contact.direction_rad
    return (world_from_robot.x_m + radius_m * math.cos(angle), world_from_robot.y_m + radius_m * math.sin(angle),
            HEIGHT_M)


LOGGER = Contacts
