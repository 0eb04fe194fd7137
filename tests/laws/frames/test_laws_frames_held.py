"""What a knowledge source holds: settings and plain values, so all else that it knows it has read from the view."""

from __future__ import annotations

import functools
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import pytest

from blackboard import Change, Condition, Effect, Level, View, Watch
from harvey.simulation.simulated_run import build_robot_model
from harvey.wiring import KNOWLEDGE_SOURCES, build, foreign_sources
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT
from sim.scenario import load_scenario
from world_models.building.world import World
from world_models.entries import UserReport
from world_models.frame_store import FrameStore

PLAIN = (type(None), bool, int, float, complex, str, bytes, Enum, type, types.ModuleType)
"""Values without anything in them."""
CODE = (types.FunctionType, types.BuiltinFunctionType, types.MethodType, types.MemberDescriptorType,
        types.GetSetDescriptorType, types.GenericAlias, classmethod, staticmethod, property, functools.partial,
        functools.cached_property)
CONTAINERS = (tuple, list, set, frozenset, Mapping)
SETTINGS = "knowledge_sources.settings"


def find_held(source: object) -> Iterator[Any]:
    """Every object that a knowledge source holds: in itself, in its classes, and in what these hold."""
    seen, todo = set[int](), [source, *type(source).__mro__[:-1]]
    kept = list[Any]()  # bound methods are made again at each look; ids are unique only as long as they live
    while todo:
        thing = todo.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        kept.append(thing)
        yield thing
        todo += _parts(thing, is_own_class=thing in type(source).__mro__ if isinstance(thing, type) else False)


def _parts(thing: Any, is_own_class: bool) -> Iterator[Any]:
    """What an object holds; of classes, those of the knowledge source itself alone, and of functions no globals."""
    if isinstance(thing, type):
        if is_own_class:
            yield from (value for name, value in vars(thing).items() if not name.startswith(("__", "_abc_")))
        return
    if isinstance(thing, PLAIN):
        return
    if isinstance(thing, Mapping):
        yield from (*thing.keys(), *thing.values())
    elif isinstance(thing, CONTAINERS):
        yield from thing
    for name in ("__self__", "__func__", "__wrapped__", "fget", "fset", "fdel", "func", "args", "keywords"):
        if isinstance(thing, CODE) or hasattr(thing, "__wrapped__"):
            yield getattr(thing, name, None)
    if isinstance(thing, types.FunctionType):
        yield from (thing.__defaults__, thing.__kwdefaults__)
        yield from (_contents(cell) for cell in thing.__closure__ or ())
    yield from getattr(thing, "__dict__", {}).values()
    slots = [vars(kind).get("__slots__", ()) for kind in type(thing).__mro__]
    names = [name for given in slots for name in ((given,) if isinstance(given, str) else given)]
    yield from (getattr(thing, name) for name in names if hasattr(thing, name) and name != "__weakref__")


def _contents(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # it is empty yet
        return None


def find_alien(source: object) -> list[object]:
    """What a knowledge source holds that is neither a plain value, nor a setting, nor code."""
    own = type(source)
    return [thing for thing in find_held(source) if thing is not source and not isinstance(
        thing, (*PLAIN, *CODE, *CONTAINERS, Condition, Watch, own)) and not type(thing).__module__.startswith(SETTINGS)]


@pytest.mark.parametrize("kind", KNOWLEDGE_SOURCES, ids=lambda kind: kind.called())
def test_a_knowledge_source_holds_settings_and_plain_values(kind: type[RobotKnowledgeSource]) -> None:
    source = build(kind, DEFAULT)
    assert find_alien(source) == []
    assert issubclass(kind, RobotKnowledgeSource) == any(thing is DEFAULT for thing in find_held(source))


def test_so_do_those_of_other_packages() -> None:
    assert [alien for kind in foreign_sources().values() for alien in find_alien(build(kind, DEFAULT))] == []


class Hoarder(RobotKnowledgeSource):
    """Holds something, in its own way."""

    level = Level.ACTION
    on = (Watch(UserReport),)
    writes = (UserReport,)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        return ()


class Slotted:
    __slots__ = ("inner",)

    def __init__(self, inner: object) -> None:
        self.inner = inner

    def method(self) -> object:
        return self.inner


def _with(name: str, value: object) -> Hoarder:
    source = Hoarder()
    setattr(source, name, value)
    return source


def _of_class(thing: object) -> Hoarder:
    return type("OfClass", (Hoarder,), {"thing": thing})()


def _by_default(thing: object) -> Hoarder:
    def act(self: Hoarder, view: View, trigger: Change, known: object = thing) -> Iterable[Effect]:
        return ()

    return type("ByDefault", (Hoarder,), {"act": act})()


def _in_watch(thing: object) -> Hoarder:
    return type("InWatch", (Hoarder,), {"on": (Watch(UserReport, where=lambda _told: thing is not None),)})()


WAYS: Mapping[str, Callable[[Any], Hoarder]] = {
    "attribute": lambda thing: _with("thing", thing),
    "list in a mapping": lambda thing: _with("things", {"a": [1, (thing,)]}),
    "key": lambda thing: _with("things", {thing: 1}),
    "closure": lambda thing: _with("find", lambda: thing),
    "bound method": lambda thing: _with("find", Slotted(thing).method),
    "partial": lambda thing: _with("find", functools.partial(print, 1, file=thing)),
    "slots": lambda thing: _with("inner", [Slotted(thing)]),
    "cached function": lambda thing: _with("find", functools.lru_cache(lambda: thing)),
    "class": _of_class,
    "default argument": _by_default,
    "predicate of a watch": _in_watch,
}


@pytest.mark.parametrize("way", WAYS)
def test_the_walk_finds_what_must_not_be_held(way: str, tmp_path: Path) -> None:
    """The building and what it comes from, what the robot knows of itself, and files."""
    robot = build_robot_model(load_scenario("shut-door"))
    world = robot.world
    assert isinstance(world, World)
    with (tmp_path / "file").open("w") as file:
        for thing in (world, world.root_frame(), FrameStore(world), robot, robot.camera, robot.mount, robot.actuator,
                      tmp_path, file):
            assert any(found is thing for found in find_alien(WAYS[way](thing))), type(thing).__name__
