"""The agent of a run: its knowledge sources, model, settings and servo levels, as its run head says.

``without`` takes away a knowledge source, a landmark or a face, or one segment of one picture
(:mod:`harvey.replay.what_if`); ``constants`` replaces servo levels, settings, and what the robot believes of itself
(``harvey settings``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

from blackboard import KnowledgeSource, Ladder, Registry, Scheduler, registry_of
from harvey.agent_settings import build_settings
from harvey.errors import BadInput
from harvey.replay.what_if import SegmentHider, WhatIf, check_removals, is_segment, parse_segments
from harvey.wiring import build, foreign_sources, knowledge_sources, servoing
from knowledge_sources.milestone.line_finder import LineFinder
from knowledge_sources.settings import Settings
from logs.run_head import RunHead
from world_models.building.world import World
from world_models.entries.entry_kinds import KINDS
from world_models.files.toml.settings_reader import parse_value, suggest_keys
from world_models.frame_store import FrameStore
from world_models.plugins import GUESTS_GROUP
from world_models.robot import RobotModel

SERVO = "servo."
SERVO_KEYS = tuple(f"{SERVO}{level}" for level in ("action", "plan", "goal"))

Sources = Callable[[Settings], Sequence[KnowledgeSource]]


@dataclass(frozen=True, eq=False)
class Agent:
    """Who decides, and by which model.

    Attributes:
        world: the building as its file describes it, from which the board gets its locale frames.
        robot: what the robot knows of itself at the start, in that building.
        store: of the locale frames.
        sources: the knowledge sources; settings: their numbers.
        servoing: the servo levels that are on.
        what_if: revises before each cycle what the robot is to know differently.
    """

    world: World
    robot: RobotModel
    store: FrameStore
    sources: tuple[KnowledgeSource, ...]
    servoing: Ladder
    settings: Settings
    what_if: WhatIf

    @property
    def kinds(self) -> Registry:
        """The kinds of entries that may be on its board."""
        return registry_of(self.sources, KINDS)

    def scheduler(self, **more: Any) -> Scheduler:
        """The knowledge sources round an empty board; ``more``: ports and sinks."""
        return Scheduler(self.sources, ladder=self.servoing, kinds=KINDS, **more)


def build_agent(head: RunHead, sources: Sources = knowledge_sources) -> Agent:
    """The agent of a run.

    Raises:
        BadInput: something to be taken away or set is not there; near names are listed.
    """
    names = [name for name in head.without if not is_segment(name)]
    segments = parse_segments(head.without)
    settings = settings_of(head)
    given = sources(settings)
    foreign = _foreign(head, {source.name for source in given})
    known = [*(source.name for source in given), *(source.called() for source in foreign)]
    world = head.load_world()
    store, removed = FrameStore(world, head.world_sha256), [name for name in names if name not in known]
    check_removals(removed, store, known)
    levels = {key.removeprefix(SERVO): value for key, value in head.constants if key.startswith(SERVO)}
    everyone = (*given, *(build(source, settings) for source in foreign))
    chosen = tuple(source for source in everyone if source.name not in names)
    if segments:
        chosen = tuple(
            SegmentHider(settings, segments) if isinstance(s, LineFinder) else s for s in chosen)
    return Agent(world, head.model(world), store, chosen, _servoing(head, levels), settings,
                 WhatIf(removed, head.constants))


def settings_of(head: RunHead) -> Settings:
    """The settings of a run. Raises BadInput."""
    return build_settings([pair for pair in head.constants if not pair[0].startswith(SERVO)], SERVO_KEYS)


def _foreign(head: RunHead, given: Set[str]) -> list[type[KnowledgeSource]]:
    """The knowledge sources of other packages that decided the run, but for those that are given already.

    Raises BadInput where one is not installed here.
    """
    needed = {name: package for name, package in head.plugins.items() if name not in given}
    installed = {**foreign_sources(GUESTS_GROUP), **foreign_sources()} if needed else {}
    for name, package in needed.items():
        if name not in installed:
            raise BadInput(f"run.json: plugins: expected the knowledge source {name!r} of {package}, which decided "
                           "this run, to be installed here, got none")
    return [installed[name] for name in needed]


def _servoing(head: RunHead, levels: dict[str, str]) -> Ladder:
    servo = head.servo_settings()
    for level, value in levels.items():
        if level not in servo.__slots__:
            raise BadInput(f"--set {SERVO}{level}: expected {suggest_keys(level, servo.__slots__)}, got {level!r}")
        if not isinstance(parse_value(value), bool):
            raise BadInput(f"--set {SERVO}{level}: expected on or off, got {value!r}")
        servo = replace(servo, **{level: parse_value(value)})
    return servoing(servo)
