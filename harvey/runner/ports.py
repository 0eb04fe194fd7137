"""Ports: where the board meets the body. They answer requests on the board with what was observed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Protocol

from blackboard.change import Change, Posted, Retracted
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from world_models.entries.body import (
    BodyFault,
    CameraPicture,
    Course,
    MotionReport,
    MotorCommand,
    PictureRequest,
    Recovery,
    Ride,
    RideReport,
)
from world_models.entries.obstacle import Contact, Ranges


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
            found = self._body.steer(entry.value)
            yield from self._answer_motion(entry, (found,) if isinstance(found, BodyFault) else found)
        elif isinstance(change, Posted) and isinstance(entry.value, PictureRequest):
            yield from self._post_with_ranges(entry, self._body.look(entry.value.purpose))
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
            yield Revise(recovery, replace(tried, status="in vain", what="the request is gone"), (recovery,))
            return
        wanted = request.value
        found = self._answer_again(wanted)
        if isinstance(found, BodyFault):
            vain = replace(tried, status="in vain", what=found.what, detail=found.detail)
            yield Revise(recovery, vain, (recovery,))
            return
        del self._unanswered[asked.request]
        yield Revise(recovery, replace(tried, status="over", what="", detail=""), (recovery,))
        if isinstance(wanted, MotorCommand | Course):
            yield from self._take_contacts(request)
        yield from self._post_with_ranges(request, found)

    def _answer_again(
        self, wanted: MotorCommand | Course | PictureRequest | Ride
    ) -> MotionReport | CameraPicture | RideReport | BodyFault:
        """The answer to a request now; a command is not carried out once more."""
        if isinstance(wanted, Ride):
            return self._body.ride(wanted)
        return self._body.claim() if isinstance(wanted, MotorCommand | Course) else self._body.look(wanted.purpose)
