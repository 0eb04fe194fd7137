"""The world's port: where the board meets the long-term model of the building (§3.4)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from blackboard import Change, Effect, KnowledgeSource, Port, Post, Posted, Revise, Scheduler
from world_models.building.locale_frame import FrameRequest
from world_models.building.world import World
from world_models.entries import LADDER
from world_models.entries.entry_kinds import KINDS
from world_models.frame_store import FrameStore
from world_models.robot import RobotModel


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
