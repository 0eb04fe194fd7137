"""Ports: where the board meets the body. They answer requests on the board with what was observed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from blackboard.change import Change, Posted
from blackboard.effect import Effect, Post
from world_models.body import Frame, Look, MotionReport, MotorCommand


class Body(Protocol):
    """A robot, simulated or of metal."""

    def execute(self, command: MotorCommand, /) -> MotionReport:
        """Carry out a command and report what the wheels claim."""
        ...

    def look(self, purpose: str, /) -> Frame:
        """Take a picture for a purpose."""
        ...


class BodyPort:
    """Carries out motor commands and takes pictures."""

    name = "body"

    def __init__(self, body: Body) -> None:
        self._body = body

    def answer(self, change: Change) -> Iterable[Effect]:
        """A motion report for a command, a frame for a look."""
        if not isinstance(change, Posted):
            return
        value = change.entry.value
        if isinstance(value, MotorCommand):
            yield Post(self._body.execute(value), (change.entry,))
        elif isinstance(value, Look):
            yield Post(self._body.look(value.purpose), (change.entry,))
