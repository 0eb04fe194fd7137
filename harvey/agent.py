"""The agent of a run: its knowledge sources, model, settings and servo levels, as its run head says.

``without`` takes away a knowledge source, a landmark or a face of the model, or one segment of one picture;
``constants`` replaces servo levels and settings (``harvey settings``).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, cast

import numpy as np

from blackboard.board import View
from blackboard.change import Change
from blackboard.effect import Effect, Post
from blackboard.kinds import Registry
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import Scheduler, registry_of
from blackboard.servoing import Servoing
from harvey.agent_settings import build_settings
from harvey.errors import BadInput
from harvey.run_files.run_head import RunHead
from harvey.wiring import build, foreign_sources, knowledge_sources, servoing
from knowledge_sources.plan.line_finder import LineFinder
from knowledge_sources.settings import Settings
from world_models.building.landmarks import Edges
from world_models.building.locale_source import LocaleGeometry, LocaleSource
from world_models.building.world import World
from world_models.entries import KINDS
from world_models.entries.percepts import Segments
from world_models.files.toml.settings import parse_value, suggest_keys
from world_models.frames import frozen
from world_models.robot import RobotModel

SEGMENT = re.compile(r"frame[- ](\d{1,9})[ ,-]+segment[- ](\d{1,9})", re.IGNORECASE | re.ASCII)
SERVO = "servo."
SERVO_KEYS = tuple(f"{SERVO}{level}" for level in ("action", "plan", "goal"))

Sources = Callable[[RobotModel, Settings], Sequence[KnowledgeSource]]


@dataclass(frozen=True, eq=False)
class Agent:
    """Who decides, and by which model.

    Attributes:
        robot: the model.
        sources: the knowledge sources; settings: their numbers.
        servoing: the servo levels that are on.
    """

    robot: RobotModel
    sources: tuple[KnowledgeSource, ...]
    servoing: Servoing
    settings: Settings

    @property
    def kinds(self) -> Registry:
        """The kinds of entries that may be on its board."""
        return registry_of(self.sources, KINDS)

    def scheduler(self, **more: Any) -> Scheduler:
        """The knowledge sources round an empty board; ``more``: ports and sinks."""
        return Scheduler(self.sources, servoing=self.servoing, kinds=KINDS, **more)


def build_agent(head: RunHead, sources: Sources = knowledge_sources) -> Agent:
    """The agent of a run.

    Raises:
        BadInput: something to be taken or set is not there; near names are listed.
    """
    names = [name for name in head.without if SEGMENT.fullmatch(name) is None]
    segments = parse_segments(head.without)
    settings = settings_of(head)
    model = head.model()
    given = sources(model, settings)
    foreign = _foreign(head, {source.name for source in given})
    known = [*(source.name for source in given), *(source.called() for source in foreign)]
    robot = replace(model, world=_lacking(model.world, [name for name in names if name not in known], known))
    levels = {key.removeprefix(SERVO): value for key, value in head.constants if key.startswith(SERVO)}
    everyone = (*sources(robot, settings), *(build(source, robot, settings) for source in foreign))
    chosen = tuple(source for source in everyone if source.name not in names)
    if segments:
        chosen = tuple(
            _SegmentHider(robot, settings, segments) if isinstance(s, LineFinder) else s for s in chosen)
    return Agent(robot, chosen, _servoing(head, levels), settings)


def settings_of(head: RunHead) -> Settings:
    """The settings of a run. Raises BadInput."""
    return build_settings([pair for pair in head.constants if not pair[0].startswith(SERVO)], SERVO_KEYS)


def _foreign(head: RunHead, given: Set[str]) -> list[type[KnowledgeSource]]:
    """The knowledge sources of other packages that decided the run, but for those that are given already.

    Raises BadInput where one is not installed here.
    """
    needed = {name: package for name, package in head.plugins.items() if name not in given}
    installed = foreign_sources() if needed else {}
    for name, package in needed.items():
        if name not in installed:
            raise BadInput(f"run.json: plugins: expected the knowledge source {name!r} of {package}, which decided "
                           "this run, to be installed here, got none")
    return [installed[name] for name in needed]


def parse_segments(names: Iterable[str]) -> tuple[tuple[int, int], ...]:
    """(frame, segment) of the names that are of that kind."""
    return tuple((int(m[1]), int(m[2])) for name in names if (m := SEGMENT.fullmatch(name)))


def _servoing(head: RunHead, levels: dict[str, str]) -> Servoing:
    servo = head.servo_settings()
    for level, value in levels.items():
        if level not in servo.__slots__:
            raise BadInput(f"--set {SERVO}{level}: expected {suggest_keys(level, servo.__slots__)}, got {level!r}")
        if not isinstance(parse_value(value), bool):
            raise BadInput(f"--set {SERVO}{level}: expected on or off, got {value!r}")
        servo = replace(servo, **{level: parse_value(value)})
    return servoing(servo)


def _lacking(world: World, names: Sequence[str], sources: Sequence[str]) -> World:
    """The model without some of its landmarks and faces; the building itself stays as it is."""
    if not names:
        return world
    packets = list(world.locale_source.all_geometry())
    there = {mark.name for p in packets for _, mark in p.landmarks} | {f.name for p in packets for _, f in p.faces}
    for name in names:
        if name not in there:
            raise BadInput(f"--without {name}: expected {_alike(name, sources, there)}, got {name!r}")
    return World(cast(LocaleSource, _Lacking(world.locale_source, frozenset(names))))


def _alike(name: str, sources: Sequence[str], elements: Set[str]) -> str:
    """The names that somebody may have meant."""
    known = sorted({*sources, *elements}, key=lambda known: (known.count("/"), known))
    meant = [text for text in known if name.lower() in text.lower()] or get_close_matches(name, known, 6, 0.5)
    names = ", ".join(meant[:6]) or f"a knowledge source ({', '.join(sources)}), a landmark or a face of the model"
    return f"{names}, or as 'frame 88 segment 12'"


class _Lacking:
    """Frames without some of their faces; a landmark that is to lack keeps its number, but has no lines any more."""

    def __init__(self, frames: LocaleSource, names: frozenset[str]) -> None:
        self._frames, self._names = frames, names

    def __getattr__(self, name: str) -> Any:
        return getattr(self._frames, name)

    def geometry(self, locale: str) -> tuple[LocaleGeometry, ...]:
        return tuple(self._without(packet) for packet in self._frames.geometry(locale))

    def all_geometry(self) -> Iterator[LocaleGeometry]:
        return (self._without(packet) for packet in self._frames.all_geometry())

    def _without(self, packet: LocaleGeometry) -> LocaleGeometry:
        no_edges = Edges.from_rows(())
        landmarks = ((n, replace(m, edges=no_edges) if m.name in self._names else m) for n, m in packet.landmarks)
        faces = (pair for pair in packet.faces if pair[1].name not in self._names)
        return replace(packet, faces=tuple(faces), landmarks=tuple(landmarks))


class _SegmentHider(LineFinder):
    """The line finder, with some segments of some pictures left out."""

    def __init__(self, robot: RobotModel, settings: Settings, segments: Sequence[tuple[int, int]]) -> None:
        super().__init__(robot, settings)
        self._segments = tuple(segments)

    @property
    def name(self) -> str:
        return "line_finder"

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        hidden = [segment for frame, segment in self._segments if frame == trigger.entry.value.number]
        for effect in super().act(view, trigger):
            if isinstance(effect, Post) and isinstance(effect.value, Segments) and hidden:
                yield Post(_fewer(effect.value, hidden), effect.because)
            else:
                yield effect


def _fewer(found: Segments, hidden: Sequence[int]) -> Segments:
    kept = np.setdiff1d(np.arange(len(found.segments_px)), hidden)
    return replace(found, segments_px=frozen(found.segments_px[kept]), sigma_px=frozen(found.sigma_px[kept]))
