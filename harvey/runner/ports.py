"""Ports: where the board meets the body, and the long-term model of the building (§3.4). They answer its requests."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from blackboard import Change, Effect, Entry, KnowledgeSource, Port, Post, Posted, Retracted, Revise, Scheduler
from knowledge_sources.methods.features import read_picture
from world_models.building.locale_frame import FrameRequest
from world_models.building.world import World
from world_models.entries import (
    LADDER,
    BodyFault,
    CameraPicture,
    Contact,
    Course,
    MotionReport,
    MotorCommand,
    PictureRequest,
    Ranges,
    Recovery,
    Ride,
    RideReport,
)
from world_models.entries.entry_kinds import KINDS
from world_models.frame_store import FrameStore
from world_models.robot import RobotModel


class Body(Protocol):
    """A robot, simulated or hardware. A fault is a value too, never an exception; the robot stands then."""

    def execute(self, command: MotorCommand, /) -> MotionReport | BodyFault:
        """Carry out a command and report what the wheels claim."""
        ...

    def steer(self, course: Course, /) -> tuple[MotionReport, CameraPicture] | BodyFault:
        """Follow a course until the next picture, or stop, and report what the wheels claim since the last."""
        ...

    def claim(self) -> MotionReport | BodyFault:
        """What the wheels claim of the last command, after a fault broke it off."""
        ...

    def take_contact(self) -> Contact | None:
        """What the robot felt to touch since the last call; asked after each motion."""
        ...

    def ranges(self) -> Ranges | None:
        """What its range sensors measure now; None where it has none or they are not wanted."""
        ...

    def look(self, purpose: str, /) -> CameraPicture | BodyFault:
        """Take a picture for a purpose."""
        ...

    def ride(self, ride: Ride, /) -> RideReport | BodyFault:
        """Ride an elevator whose button somebody presses; a fault where nobody does."""
        ...

    def wait(self, duration_s: float, /) -> float:
        """Stand still for a while; returns the time after it, by the body's clock [s]."""
        ...

    def stop(self) -> None:
        """Stop at once and for good."""
        ...


MUST_CHANGE_M, MUST_CHANGE_RAD = 0.02, math.radians(1.0)
"""After wheels that counted more, no picture is the same as the one before."""
STANDS_STILL = "camera stands still"
"""What the fault of a camera is called that delivers one picture for ever, whatever its stamps say."""


class StillCamera:
    """Finds a camera that stands still: its picture, to the last pixel, is still the one before the wheels counted."""

    def __init__(self) -> None:
        self._jpeg = b""
        self._turned_rad = self._moved_m = 0.0

    def move(self, turn_rad: float, move_m: float) -> None:
        """The wheels counted a motion."""
        self._turned_rad, self._moved_m = self._turned_rad + turn_rad, self._moved_m + move_m

    def find(self, jpeg: bytes) -> str:
        """What is wrong with a picture, in words; "" for nothing."""
        if not jpeg or not _is_same(self._jpeg, jpeg):
            self._jpeg, self._turned_rad, self._moved_m = jpeg, 0.0, 0.0
            return ""
        if abs(self._turned_rad) < MUST_CHANGE_RAD and abs(self._moved_m) < MUST_CHANGE_M:
            return ""
        return (f"its picture is the same as before the wheels counted {math.degrees(self._turned_rad):.0f} degrees and"
                f" {self._moved_m:.2f} m")


def _is_same(before: bytes, jpeg: bytes) -> bool:
    """Whether two pictures are equal; pixels are compared where one may be the other with another head."""
    if before == jpeg or abs(len(before) - len(jpeg)) > len(jpeg) // 50:
        return before == jpeg
    try:
        return np.array_equal(read_picture(before).grey, read_picture(jpeg).grey)
    except ValueError:
        return False


class BodyPort:
    """Carries out motor commands and takes pictures.

    A request that a fault keeps from being answered stays open here until a recovery is asked for and succeeds. Then
    it is answered as it would have been before.
    """

    name = "body"
    acts_on = (MotorCommand, Course, PictureRequest, Ride, Recovery)
    """The requests that it answers; all of them are marked as such, so each is in the journal before it comes here."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._unanswered: dict[str, Entry[Any]] = {}
        self._still, self._counted = StillCamera(), dict[str, MotionReport]()

    def remember(self, request: Entry[Any]) -> None:
        """Keep a request that another process did not answer: a recovery will ask for it here."""
        self._unanswered[request.id] = request

    def answer(self, change: Change) -> Iterable[Effect]:
        """A motion report for a command, a frame for a look, the answer to an older request for a recovery."""
        entry = change.entry
        if isinstance(entry.value, Recovery) and entry.value.status == "asked":
            yield from self._try_again(entry)
        elif isinstance(change, Posted) and isinstance(entry.value, MotorCommand):
            yield from self._answer_motion(entry, (self._body.execute(entry.value),))
        elif not isinstance(change, Retracted) and isinstance(entry.value, Course):
            yield from self._answer_motion(entry, self._steer(entry))
        elif isinstance(change, Posted) and isinstance(entry.value, PictureRequest):
            yield from self._post_with_ranges(entry, self._look(entry.value.purpose))
        elif isinstance(change, Posted) and isinstance(entry.value, Ride):
            yield self._post(entry, self._body.ride(entry.value))

    def _answer_motion(
        self, request: Entry[Any], found: Iterable[MotionReport | CameraPicture | BodyFault]
    ) -> Iterable[Effect]:
        """What a motion touched, then how it ended; a fault in which something was touched rests on the contact too."""
        touched = self._take_contacts(request)
        yield from touched
        for answer in found:
            yield from self._post_with_ranges(request, answer, touched if isinstance(answer, BodyFault) else ())

    def _steer(self, request: Entry[Course]) -> tuple[MotionReport | CameraPicture | BodyFault, ...]:
        """The next part of a motion; where the camera hangs, the base stops, and that is a fault."""
        found = self._body.steer(request.value)
        if isinstance(found, BodyFault):
            return (found,)
        report, picture = found
        self._still.move(report.turn_rad, report.move_m)
        seen = self._check(picture)
        if isinstance(seen, CameraPicture):
            return report, seen
        end = self._body.steer(replace(request.value, speed_m_per_s=0.0))
        rest = end if isinstance(end, BodyFault) else end[0]
        turn, move = report.turn_rad + (rest.turn_rad or 0.0), report.move_m + (rest.move_m or 0.0)
        self._counted[request.id] = replace(report, turn_rad=turn, move_m=move)
        return (replace(seen, turn_rad=turn, move_m=move),)

    def _look(self, purpose: str) -> CameraPicture | BodyFault:
        found = self._body.look(purpose)
        return found if isinstance(found, BodyFault) else self._check(found)

    def _check(self, picture: CameraPicture) -> CameraPicture | BodyFault:
        wrong = self._still.find(picture.jpeg)
        return BodyFault("camera", STANDS_STILL, wrong, "", picture.sim_time_s) if wrong else picture

    def _take_contacts(self, request: Entry[Any]) -> tuple[Effect, ...]:
        contact = self._body.take_contact()
        return () if contact is None else (Post(contact, (request,)),)

    def _post_with_ranges(
        self, request: Entry[Any], found: MotionReport | CameraPicture | RideReport | BodyFault,
        why: tuple[Effect, ...] = (),
    ) -> Iterable[Effect]:
        """An answer; with a picture comes what range sensors measure at the same place and time."""
        ranges = self._body.ranges() if isinstance(found, CameraPicture) else None
        if ranges is not None:
            yield Post(ranges, (request,))
        yield self._post(request, found, why)

    def _post(
        self, request: Entry[Any], found: MotionReport | CameraPicture | RideReport | BodyFault,
        why: tuple[Effect, ...] = (),
    ) -> Effect:
        if isinstance(found, MotionReport | BodyFault) and isinstance(request.value, MotorCommand):
            self._still.move(found.turn_rad or 0.0, found.move_m or 0.0)
        if isinstance(found, BodyFault):
            self._unanswered[request.id] = request
            return Post(replace(found, request=request.id), (request, *why))
        return Post(found, (request,))

    def _try_again(self, recovery: Entry[Recovery]) -> Iterable[Effect]:
        asked = recovery.value
        now_s = self._body.wait(asked.wait_s)
        tried = replace(asked, tries=asked.tries + 1, waited_s=now_s - asked.since_s)
        request = self._unanswered.get(asked.request)
        if request is None:  # the process that it was asked of is gone
            yield Revise(recovery, replace(tried, status="still failing", what="the request is gone"), (recovery,))
            return
        found = self._answer_again(request)
        if isinstance(found, BodyFault):
            failing = replace(tried, status="still failing", what=found.what, detail=found.detail)
            yield Revise(recovery, failing, (recovery,))
            return
        del self._unanswered[asked.request]
        yield Revise(recovery, replace(tried, status="over", what="", detail=""), (recovery,))
        if isinstance(request.value, MotorCommand | Course):
            yield from self._take_contacts(request)
        yield from self._post_with_ranges(request, found)

    def _answer_again(
        self, request: Entry[MotorCommand | Course | PictureRequest | Ride]
    ) -> MotionReport | CameraPicture | RideReport | BodyFault:
        """The answer to a request now; a command is not carried out once more."""
        wanted = request.value
        if request.id in self._counted:  # only its picture was wrong
            seen = self._look("track")
            return seen if isinstance(seen, BodyFault) else self._counted.pop(request.id)
        if isinstance(wanted, Ride):
            return self._body.ride(wanted)
        return self._body.claim() if isinstance(wanted, MotorCommand | Course) else self._look(wanted.purpose)


class WorldPort:
    """Answers requests for locale frames from a frame store."""

    name = "world"
    acts_on = (FrameRequest,)

    def __init__(self, store: FrameStore) -> None:
        self._store = store

    def answer(self, change: Change) -> Iterable[Effect]:
        """The frames, and the request with what else was asked; a locale that there is not is an answer too."""
        request = change.entry
        if not isinstance(change, Posted) or not isinstance(request.value, FrameRequest):
            return
        frames, answered = self._store.answer(request.value)
        yield from (Post(frame, (request,)) for frame in frames)
        yield Revise(request, answered, (request,))


def tell_robot(scheduler: Scheduler, robot: RobotModel) -> None:
    """Put what a robot knows of itself on the board: the first entries of a run."""
    scheduler.post([Post(entry) for entry in robot.entries()], "robot")


def build_scheduler(
    sources: Sequence[KnowledgeSource], world: World, robot: RobotModel, *, ports: Sequence[Port] = (), **more: Any
) -> Scheduler:
    """Knowledge sources round a board that knows the robot, all servo levels on, and can ask for the building.

    Args:
        ports: to the body; more: as for :class:`blackboard.scheduler.Scheduler`.
    """
    scheduler = Scheduler(sources, ports=(*ports, WorldPort(FrameStore(world))), ladder=LADDER, kinds=KINDS, **more)
    tell_robot(scheduler, robot)
    return scheduler
