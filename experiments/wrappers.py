"""Wrappers of bodies and knowledge sources: experiments override what they measure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from blackboard.board import View
from blackboard.change import Change
from blackboard.effect import Effect
from blackboard.knowledge_source import KnowledgeSource
from harvey.runner.ports import Body
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Ride, RideReport
from world_models.entries.obstacle import Contact, Ranges


class WrappedBody:
    """Passes every request on to another body."""

    def __init__(self, body: Body) -> None:
        self._body = body

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        return self._body.execute(command)

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        return self._body.steer(course)

    def claim(self) -> MotionReport | BodyFault:
        return self._body.claim()

    def take_contact(self) -> Contact | None:
        return self._body.take_contact()

    def ranges(self) -> Ranges | None:
        return self._body.ranges()

    def look(self, purpose: str) -> Frame | BodyFault:
        return self._body.look(purpose)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        return self._body.ride(ride)

    def wait(self, duration_s: float) -> float:
        return self._body.wait(duration_s)

    def stop(self) -> None:
        self._body.stop()


class WrappedSource(KnowledgeSource):
    """Passes everything on to another knowledge source."""

    def __init__(self, inner: KnowledgeSource) -> None:
        self._inner = inner
        for name in ("level", "closes", "on", "writes"):
            setattr(self, name, getattr(inner, name))

    @property
    def name(self) -> str:
        return self._inner.name

    def bind(self, view: View, trigger: Change) -> Any | None:
        return self._inner.bind(view, trigger)

    def rate(self, case: Any) -> float:
        return self._inner.rate(case)

    def act(self, view: View, case: Any) -> Iterable[Effect]:
        return self._inner.act(view, case)
