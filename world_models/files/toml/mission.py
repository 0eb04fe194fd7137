"""A mission's file: what a scenario of the simulator and a mission on hardware have in common.

World, goal, start, arrival, servo levels, way of driving, limits. Each format adds tables of its own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args, get_type_hints

from world_models.building.world import World
from world_models.commands import check_command, check_destination, parse_destination
from world_models.entries.location import diagonal
from world_models.entries.task import DOOR_STATES, GO_ON, Command, Redirection, ReportedState, UserReport
from world_models.files.packed import SUFFIXES
from world_models.files.toml.settings_reader import (
    MAX_NUMBER,
    known_keys,
    parse_value,
    read_all,
    read_settings,
    replace_value,
    suggest_keys,
)
from world_models.files.toml.source import WORLDS, Node, Source, WorldError
from world_models.plugins import SOURCES_GROUP, list_absent
from world_models.units import Bounded, Bounds, bounded, check_bounds

ROOT = WORLDS.parents[1]
"""The folder of the packages: files that come with the project are named relative to it."""
OBSTACLE = re.compile(r".+/obstacle-\d+")
"""How an obstacle that the robot found is called."""
TURN = 2.0 * math.pi  # largest heading that may be written [rad]
MIN_SIGMA = 0.005
"""Floor of the start's standard deviations [m, rad]: nobody puts a robot down better."""


@dataclass(frozen=True, slots=True)
class Start(Bounded):
    """How the robot is put down.

    Attributes:
        heading_rad: in the first locale's frame, counter-clockwise from its x axis.
        put_down_sigma_m, put_down_sigma_rad: standard deviations of the placing, along each axis and of the heading.
    """

    heading_rad: float = bounded(0.0, -TURN, TURN)
    put_down_sigma_m: float = bounded(0.0, 0.0, 2.0)
    put_down_sigma_rad: float = bounded(0.0, 0.0, math.pi)


@dataclass(frozen=True, slots=True)
class Arrival:
    """How the robot is to stand at the goal.

    Attributes:
        heading_rad: in the last locale's frame; NaN for any.
    """

    heading_rad: float = math.nan

    def __post_init__(self) -> None:
        if self.matters:
            check_bounds(self, {"heading_rad": Bounds(-TURN, TURN)})

    @property
    def matters(self) -> bool:
        return not math.isnan(self.heading_rad)


@dataclass(frozen=True, slots=True)
class Telling(Bounded):
    """What somebody tells the robot on the way, of the building or to go elsewhere: one of the file's ``[[told]]``.

    Attributes:
        at_s: when, by the time of the run.
        what: name of a door or thing, as ``library-door`` or ``allens-office/desk``.
        state: shut or open (a door), gone or there (a thing).
        goal: where to go instead, as "Go to the library", or "go on"; then ``what`` and ``state`` are left out.
        task: what to do instead, as "Fetch the book", read on the way (needs harvey-words); then all others are.
    """

    at_s: float = bounded(0.0, 0.0, MAX_NUMBER)
    what: str = ""
    state: str = ""
    goal: str = ""
    task: str = ""

    def __post_init__(self) -> None:
        Bounded.__post_init__(self)
        if self.task:
            if self.goal or self.what or self.state:
                raise ValueError("expected either task, or goal, or what and state, got several")
            if TASK_READER in (absent := list_absent(SOURCES_GROUP)):
                raise ValueError(f"expected what reads tasks to be installed, which needs {absent[TASK_READER]}")
            return
        if self.goal:
            if self.what or self.state:
                raise ValueError("expected either goal, or what and state, got both")
            if self.goal != GO_ON:
                check_destination(self.goal)
            return
        if not self.what:
            raise ValueError("expected what = the name of a door or thing, got none")
        if self.state not in get_args(ReportedState):
            raise ValueError(f"expected state = one of {', '.join(get_args(ReportedState))}, got {self.state!r}")

    @property
    def entry(self) -> UserReport | Redirection:
        """What is put on the board."""
        if self.task or self.goal:
            return Redirection(self.task or self.goal)
        state: ReportedState = next(state for state in get_args(ReportedState) if state == self.state)
        return UserReport(self.what, state)

    def find_fault(self, world: World) -> str:
        """What is wrong where a world has no such door, thing or room, in words; "" where it has."""
        if self.task:
            return ""
        if self.goal:
            try:
                _ = self.goal == GO_ON or parse_destination(self.goal, world)
            except ValueError as error:
                return str(error)
            return ""
        if self.state in DOOR_STATES:
            kind, known = "an open door", [doorway.name for doorway in world.doorways]
        else:
            kind, known = "a thing", [thing.name for thing in world.things]
            if self.state == "gone" and OBSTACLE.fullmatch(self.what):
                return ""  # what the robot will have found by then
        return "" if self.what in known else f"expected {kind}, {suggest_keys(self.what, known)}, got {self.what!r}"


@dataclass(frozen=True, slots=True)
class Servo:
    """Which levels of perceptual servoing (Figure 2) are on.

    Attributes:
        action: landmarks tracked from picture to picture correct each increment of a move.
        plan: milestones are looked at, and correct the pose estimate.
        goal: a robot that is lost finds itself again.
    """

    action: bool = True
    plan: bool = True
    goal: bool = True


@dataclass(frozen=True, slots=True)
class Motion:
    """How legs are driven.

    Attributes:
        continuous: without stopping at each increment: corrected on the move, thirty times a second.
    """

    continuous: bool = False


@dataclass(frozen=True, slots=True)
class Limits(Bounded):
    """When to give up.

    Attributes:
        max_time_s: by the time of the run.
        max_cycles: of the blackboard.
    """

    max_time_s: float = bounded(3600.0, 0.0, MAX_NUMBER, above=True)
    max_cycles: int = bounded(20000, 0, MAX_NUMBER, above=True)


@dataclass(frozen=True, slots=True)
class Safety:
    """What a person has to do with a robot that has stopped.

    Attributes:
        restart: after a contact or an emergency stop: automatic, or asked: only when somebody says so (ISO 3691-4).
    """

    restart: str = "automatic"

    def __post_init__(self) -> None:
        if self.restart not in ("automatic", "asked"):
            raise ValueError(f"expected restart = automatic or asked, got {self.restart!r}")


TABLES: Mapping[str, type[Any]] = {
    "start": Start, "arrival": Arrival, "servo": Servo, "motion": Motion, "safety": Safety, "limits": Limits}
"""The tables that every mission may have."""
TASK_READER = "task_reader"
TEXTS = ("description", "world", "goal", "task")


@dataclass(frozen=True, eq=False, kw_only=True)
class Mission:
    """A mission as its file gives it; the tables of the file are the attributes of the same name.

    Attributes:
        name: the file's, without its ending.
        world: the world file that the robot believes in.
        goal: in words, or in conceptual-dependency form with coordinates in feet.
        told: what the robot is told on the way; first the ``task`` of the file, if it has one.
        folder: where the file is; file names in it are relative to it.
        source: the file, with the settings that replaced some of its values.
    """

    name: str
    description: str = ""
    world: Path
    goal: str
    start: Start
    arrival: Arrival
    servo: Servo
    motion: Motion
    safety: Safety
    limits: Limits
    told: tuple[Telling, ...] = ()
    folder: Path
    source: Source = field(repr=False)

    @property
    def command(self) -> Command:
        """What the user asks for, and how the robot is put down."""
        s = self.start
        covariance = diagonal(max(s.put_down_sigma_m, MIN_SIGMA), max(s.put_down_sigma_rad, MIN_SIGMA))
        return Command(self.goal, s.heading_rad, self.arrival.heading_rad if self.arrival.matters else None, covariance,
                       self.safety.restart == "asked")


@dataclass(frozen=True, slots=True)
class MissionFormat:
    """One kind of mission file.

    Attributes:
        tables: the settings class of each table.
        others: further keys at the top of the file, which the caller reads.
        inner: the settings class of each table that is one of these or within one, as ``truth.camera``.
    """

    tables: Mapping[str, type[Any]]
    others: tuple[str, ...] = ()
    inner: Mapping[str, type[Any]] = field(default_factory=dict)

    def keys(self) -> tuple[str, ...]:
        """Every key that :meth:`with_settings` understands."""
        return (*TEXTS, *(f"{name}.{key}" for name, kind in self._kinds.items() for key in known_keys(kind)))

    def with_settings(self, source: Source, settings: Mapping[str, Any]) -> Source:
        """The file with some values replaced, as ``{"servo.action": "off", "start.heading_deg": 90}``.

        Raises:
            WorldError: a key is unknown; near ones are listed.
        """
        for key, value in settings.items():
            if key not in self.keys():
                raise WorldError(f"--set {key}: expected {suggest_keys(key, self.keys())}, got {key!r}")
            path = tuple(key.split("."))
            new = value if self._is_text(path) or not isinstance(value, str) else parse_value(value)
            data = replace_value(self._without_other_spellings(source.data, path), path, new)
            source = replace(source, data=data, settings=source.settings | {path})
        return source

    def read(self, source: Source, name: str, folder: Path) -> dict[str, Any]:
        """The attributes of a :class:`Mission`, and the other tables of the format. Raises WorldError."""
        node = source.root.table(("world", "goal"), ("description", "task", "told", *self.others, *self.tables))
        tables = {key: read_settings(node[key], kind) if key in node else kind() for key, kind in self.tables.items()}
        first = (Telling(task=node["task"].text()),) if "task" in node else ()
        return {
            "told": (*first, *read_all(node, "told", Telling)), "name": name,
            "description": node["description"].text() if "description" in node else "",
            "world": named_file(node["world"].text(), WORLDS, folder), "goal": _goal(node["goal"]),
            "folder": folder, "source": source, **tables,
        }

    def _is_text(self, path: tuple[str, ...]) -> bool:
        """Whether a key holds a text: then ``--set`` does not read its value as TOML."""
        if len(path) == 1:
            return True
        kind = self._kinds[".".join(path[:-1])]
        return get_type_hints(kind)[known_keys(kind)[path[-1]][0]] is str

    @property
    def _kinds(self) -> Mapping[str, type[Any]]:
        """The settings class of each table whose keys can be set."""
        return {**self.tables, **self.inner}

    def _without_other_spellings(self, data: Mapping[str, Any], path: tuple[str, ...]) -> Mapping[str, Any]:
        """The tables without the same setting in another unit."""
        table: Any = data
        for step in path[:-1]:
            table = table.get(step) if isinstance(table, Mapping) else None
        if len(path) == 1 or not isinstance(table, Mapping):
            return data
        known = known_keys(self._kinds[".".join(path[:-1])])
        others = {key for key in table if key in known and known[key][0] == known[path[-1]][0]}
        return replace_value(data, path[:-1], {key: value for key, value in table.items() if key not in others})


def named_file(text: str, shipped: Path, folder: Path) -> Path:
    """A file that comes with the project, by its bare name, or any file, relative to the mission's folder."""
    return folder / text if text.endswith((".toml", *SUFFIXES)) else shipped / f"{text}.toml"


def _goal(node: Node) -> str:
    try:
        check_command(node.text())
    except WorldError:
        raise
    except ValueError as error:
        raise WorldError(f"{node.place}: {error}") from None
    return node.text()
