"""Tests for a knowledge source: a board with what a law puts there, a plain house, a robot in it, and ``check_source``.

[Test it](../docs/how-to/test-it.md) has ten lines. No test runner is needed: what does not hold is an AssertionError.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from blackboard import (
    Blackboard,
    Change,
    Effect,
    Entry,
    KnowledgeSource,
    Level,
    MissingEntryError,
    Post,
    Posted,
    Ref,
    Retract,
    Revise,
    Revised,
    StaleError,
    View,
    kind_of,
    plain,
)
from blackboard.board import TracedView
from blackboard.effect import type_of
from harvey.wiring import build, load_kinds
from knowledge_sources.settings import DEFAULT
from world_models import entries
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries.location import Covariance
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose2
from world_models.robot import RobotModel

HOUSE = Path(__file__).with_name("house.toml").read_text("utf-8")
"""Two rooms and the door between them."""
HALL, STUDY = "hall", "study"
SURE = entries.diagonal(0.01, 0.005)


@cache
def house() -> World:
    """The building, read once."""
    return read_world(Source.parse(HOUSE, "house.toml"))


def plain_robot(world: World | None = None, *, continuous: bool = False,
                actuator: ActuatorModel | None = None) -> RobotModel:
    """A robot in the house, or in another world."""
    camera = Camera.from_field_of_view(math.radians(65.0), 256, 256)
    mount = CameraMount(height_m=1.0, forward_m=0.12, tilt_rad=0.1)
    return RobotModel(world or house(), camera, mount, actuator or ActuatorModel(), continuous=continuous)


def answer(source: KnowledgeSource, view: View, trigger: Change) -> tuple[Effect, ...] | None:
    """The effects by which a source answers a trigger, asked as the scheduler does; None where it could not act."""
    case = source.find_case(view, trigger)
    return None if case is None else tuple(source.act(view, case))


class Bench:
    """A board on which a law puts what it needs, one cycle after the other; ``revisions`` has all that ever was there.

    Args:
        robot: whose camera, wheels and footprint are put there, with all frames of its world; None for an empty board.
    """

    def __init__(self, robot: RobotModel | None = None) -> None:
        self.board = Blackboard()
        self.cycle = 0
        self.robot = robot
        self.revisions: dict[Ref, Entry[Any]] = {}
        if robot is not None:
            assert isinstance(robot.world, World)
            store = FrameStore(robot.world)
            for value in (*robot.entries(), *(store.frame(name) for name in ("", *robot.world.locales))):
                self.put(value)

    @property
    def view(self) -> View:
        return self.board.view

    def put(self, value: Any, *because: Entry[Any]) -> Entry[Any]:
        """A new entry."""
        return self.apply(Post(value, because))[0].entry

    def revise(self, entry: Entry[Any], **fields: Any) -> Entry[Any]:
        """The current revision of an entry, with other values in some fields."""
        now = self.view[entry.id]
        return self.apply(Revise(now, replace(now.value, **fields), (now,)))[0].entry

    def retract(self, entry: Entry[Any]) -> None:
        self.apply(Retract(self.view[entry.id]))

    def apply(self, *effects: Effect) -> tuple[Change, ...]:
        """The changes that effects make, in a cycle of their own."""
        self.cycle += 1
        changes = self.board.apply(effects, author="test", cycle=self.cycle)
        self.revisions |= {change.entry.ref: change.entry for change in changes}
        return changes

    def ask(self, source: KnowledgeSource, trigger: Entry[Any]) -> tuple[Effect, ...] | None:
        """What a source makes of an entry that was just posted or revised; None where it does not act."""
        return answer(source, self.view, change_of(trigger))

    def believe(self, pose: Pose2 | None = None, covariance: Covariance = SURE, *, locale: str = HALL,
                basis: str = "milestone", motion: str = "") -> Entry[entries.Hypothesis]:
        """A belief that is held; ``pose`` in the locale's frame."""
        return self.put(entries.Hypothesis(locale, pose or Pose2(2.0, 2.0, 0.0), covariance, basis, motion=motion))

    def doubt(self, level: Level = Level.GOAL, magnitude: float | None = None) -> Entry[entries.Discrepancy]:
        """A discrepancy that is open at a level; by default the robot is lost."""
        return self.put(entries.Discrepancy(level, "what a law says", magnitude, (5.0, 30.0), "px"))

    def move(self, turn_rad: float = 0.0, move_m: float = 0.5) -> tuple[
            Entry[entries.MotorCommand], Entry[entries.MotionReport]]:
        """A motor command, and the report that it was carried out; no belief has it yet."""
        command = self.put(entries.MotorCommand(turn_rad, move_m))
        until_s = 1.0 + len(self.view.all(entries.MotionReport))
        return command, self.put(entries.MotionReport(turn_rad, move_m, 1.0, until_s), command)


def change_of(entry: Entry[Any]) -> Change:
    """The change that made an entry what it is."""
    return Revised(entry) if entry.revision else Posted(entry)


def copy_of(board: Blackboard, *without: str) -> Blackboard:
    """A board with the same entries, but for some ids, that can be changed without it."""
    other = Blackboard()
    other._numbers.update(board._numbers)
    for store in board._stores.values():
        for entry in store.entries.values():
            if entry.id not in without:
                other.follow(Posted(entry))
    return other


TRACED = frozenset(kind for kind in load_kinds().values() if kind_of(kind).traced)
"""Kinds of which the scheduler itself notes what an act reads: nobody has to name them."""
ID = re.compile(r"'([A-Z][A-Za-z]+-[0-9]+)'")
"""An entry's id in a value that is written out."""


def describe(effects: Iterable[Effect], *, with_reasons: bool = False) -> list[str]:
    """What an act makes, as text; without its reasons, unless they are asked for."""
    return [repr((type(e).__name__, None if isinstance(e, Post) else e.entry.ref,
                  None if isinstance(e, Retract) else plain(e.value), reasons(e) if with_reasons else ()))
            for e in effects]


def reasons(effect: Effect) -> list[str]:
    """What an effect names, directly: ids of entries, and of its act's other effects the kinds of their values."""
    return sorted({r.id if isinstance(r, Entry | Ref) else type(r.value).__name__ for r in effect.because})


def find_named(board: Blackboard, trigger: Change, effects: tuple[Effect, ...]) -> set[str]:
    """The ids of what an act names, of what that rests on, and of what the values of these refer to."""
    found: list[Any] = [trigger.entry, *(reason for e in effects for reason in e.because)]
    found += [e.entry for e in effects if not isinstance(e, Post)]
    named = {reason.id for reason in found if isinstance(reason, Entry | Ref)}
    named |= {ref.id for id in tuple(named) if (entry := board.current.get(id)) is not None for ref in entry.because}
    todo = list(named)
    while todo:
        entry = board.current.get(todo.pop())
        more = set() if entry is None else set(ID.findall(repr(plain(entry.value)))) - named
        named |= more
        todo += more
    return named


Break = Callable[[View], Iterable[Effect]]
"""Makes a condition false on a board on which it holds."""


def end_all(kind: type[Any], **fields: Any) -> Break:
    """Gives all entries of a kind other values in some fields; with none, it withdraws them."""
    return lambda view: [Revise(e, replace(e.value, **fields)) if fields else Retract(e) for e in view.all(kind)]


def add(value: Any) -> Break:
    return lambda view: [Post(value)]


DOUBT = entries.Discrepancy(Level.PLAN, "by a law", None, (5.0, 30.0), "px")
CAR = entries.Place("car-1", 0.0, 0.0)
RIDE = entries.Subgoal(CAR, replace(CAR, locale="car-2"), primitive=False, passage="lift")
BREAKS: Mapping[str, Break] = {
    **dict.fromkeys(("not given up", "not over", "not ended"), add(entries.Outcome("stopped", "by a law"))),
    **dict.fromkeys(("belief up to date", "standing"), add(entries.MotorCommand(0.1, 0.0))),
    **dict.fromkeys(("no doubt", "no unmeasured doubt"), add(DOUBT)),
    **dict.fromkeys(("not lost", "no doubt above"), add(replace(DOUBT, level=Level.GOAL))),
    **dict.fromkeys(("lost", "an unmeasured doubt", "a doubt at the plan level"),
                    end_all(entries.Discrepancy, status="corrected")),
    "a belief": end_all(entries.Hypothesis, status="candidate"),
    "a picture": end_all(entries.CameraPicture),
    "a known floor": add(entries.PlanSketch("Goal-9", (), "", (RIDE,), 1)),
    "no fault": add(entries.BodyFault("base", "stalled", "by a law", "MotorCommand-1", 1.0)),
    "a milestone awaited": end_all(entries.Milestone, status="withdrawn"),
    "no milestone awaited": add(entries.Milestone("", 0, "by a law", 0.0)),
    "a goal": end_all(entries.Goal, status="abandoned"),
    "a sketch": end_all(entries.PlanSketch, status="done"),
    "a camera": end_all(entries.CameraState),
    "a way since a known place": end_all(entries.Travel),
}
"""How each condition of the robot's own sources comes to be broken."""


def check_source(
    source: type[KnowledgeSource] | KnowledgeSource, on: Bench, trigger: Entry[Any] | Change, *,
    without: Collection[str] = (), breaks: Mapping[str, Break] = BREAKS, most_hidden: int = 4,
    alike: Iterable[tuple[Bench, Entry[Any], Callable[[Any], Any]]] = (),
) -> tuple[Effect, ...]:
    """Holds one act of a source to the laws of all sources: AssertionError says which it broke.

    It watches for what woke it, and rates it from 0 to 1. It writes only kinds that it declares, each effect has a
    reason, and what it read and does not name changes nothing. Where one of its ``needs`` is not met it has no case.
    What it does for a trigger that is overtaken names that, is the same, or is refused. Asked again, after all this, it
    does the same, as does another of its class, and the board is as it was.

    Args:
        source: its class, or one that was built.
        on: the board as the act sees it.
        trigger: what woke it, or the entry that was just posted or revised.
        without: ids of entries; without any of them it cannot act.
        breaks: what breaks a condition, by its name.
        most_hidden: of so many kinds what it did not name is hidden, one entry at a time.
        alike: boards that are as this one in a mirror, another frame, other units or another order; what woke it there;
            and what a value that it writes is there.

    Returns what it does.
    """
    one = source if isinstance(source, KnowledgeSource) else build(source, DEFAULT)
    board, other = on.board, deepcopy(one)
    woken = change_of(trigger) if isinstance(trigger, Entry) else trigger
    who, before, view = f"{one.name}, woken by {woken.entry.ref},", dict(board.current), TracedView(board, None)
    assert any(watch.sees(woken) for watch in one.on), f"{who} does not watch for that"
    case, unmet = one.find_case(view, woken), one.find_unmet(board.view)
    assert case is not None, f"{who} has no case; it needs {unmet.name if unmet else 'what its bind looks for'}"
    assert 0.0 <= one.rate(case) <= 1.0, f"{who} is rated {one.rate(case)}"
    effects = tuple(one.act(view, case))
    made = describe(effects)
    assert {type_of(e) for e in effects} <= set(one.writes), f"{who} writes what it does not declare"
    assert all(e.because for e in effects), f"{who} has an effect without a reason"
    copy_of(board).apply(effects, author=one.name, cycle=10**6)
    read, named = (board.current[ref.id] for ref in sorted(view.used)), find_named(board, woken, effects)
    newest = {type(e.value): e for e in sorted(read, key=lambda e: (e.cycle, e.id)) if e.id not in named}
    for entry in [entry for kind, entry in newest.items() if kind not in TRACED][:most_hidden]:
        again = make_without(one, board, woken, entry.id)
        assert not again or set(made) <= set(again), f"{who} does not name {entry.ref}"
    for id in without:
        assert not make_without(one, board, woken, id), f"{who} acts without {id}"
    for need in one.needs:
        assert need.name in breaks, f"{who} needs {need.name}: say what breaks it"
        broken = copy_of(board)
        broken.apply(breaks[need.name](broken.view), author="test", cycle=10**6)
        assert need.find(broken.view) in (None, False), f"{need.name} is met still where it should be broken"
        assert one.find_case(broken.view, woken) is None, f"{who} has a case without {need.name}"
    earlier = on.revisions.get(Ref(woken.entry.id, woken.entry.revision - 1))
    if earlier is not None and any(watch.sees(stale := type(woken)(earlier)) for watch in one.on):
        late = answer(one, board.view, stale) or ()
        is_right = describe(late) in ([], made) or any(earlier in e.because for e in late) or is_stale(board, late)
        assert is_right, f"{who} does otherwise for {earlier.ref}, which is overtaken"
    for asked in (one, other):
        told = describe(answer(asked, board.view, woken) or (), with_reasons=True)
        assert told == describe(effects, with_reasons=True), f"{who} decides otherwise on the same board"
    assert board.current == before, f"{who} changes the board itself"
    for bench, entry, turned in alike:
        there, here = ([e.value for e in found if not isinstance(e, Retract)] for found in (
            bench.ask(one, entry) or (), effects))
        assert is_near(there, [turned(value) for value in here]), f"{who} makes {here}, and {there} on a board alike"
    return effects


def make_without(source: KnowledgeSource, board: Blackboard, trigger: Change, id: str) -> list[str]:
    """What it makes where an entry is not there; nothing where it asks for that."""
    try:
        return describe(answer(source, copy_of(board, id).view, trigger) or ())
    except MissingEntryError:
        return []
    except (LookupError, AttributeError):
        return ["it cannot decide"]


def is_stale(board: Blackboard, effects: Iterable[Effect]) -> bool:
    """Whether a board refuses what names a revision that is not current."""
    try:
        copy_of(board).apply(effects, author="test", cycle=10**6)
    except StaleError:
        return True
    return False


def is_near(one: Any, other: Any) -> bool:
    """Whether values are equal, but numbers for rounding."""
    one, other = plain(one), plain(other)
    if isinstance(one, Mapping):
        return isinstance(other, Mapping) and one.keys() == other.keys() and all(is_near(one[k], other[k]) for k in one)
    if isinstance(one, list):
        return isinstance(other, list) and len(one) == len(other) and all(map(is_near, one, other))
    if isinstance(one, float):
        return isinstance(other, float | int) and math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-9)
    return bool(one == other)
