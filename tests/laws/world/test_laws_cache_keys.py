"""What a building remembers is asked for by all that it depends on: a key lacks nothing of what the answer is made of.

Read in the code, each call of ``cached`` by itself: no run asks the same of two clearances one after the other.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from generated_boards import to_world
from harvey.testing import HOUSE, plain_robot
from knowledge_sources.methods.localization.aliasing import _find_visible_on_grid
from knowledge_sources.methods.verification import predict_lines
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

ROOT = Path(__file__).parents[3]
ROOMS = ("knowledge_sources", "world_models")
MANY = 12


def names_in(node: ast.AST) -> set[str]:
    """The variables that are read, and what is read of ``self``, but for the methods that are called."""
    called = {id(one.func) for one in ast.walk(node) if isinstance(one, ast.Call)}
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Load)} | {
        f"self.{one.attr}" for one in ast.walk(node) if isinstance(one, ast.Attribute) and id(one) not in called
        and isinstance(one.value, ast.Name) and one.value.id == "self"}


def list_made(function: ast.FunctionDef) -> dict[str, set[str]]:
    """The variables that a function makes, and what each is made of."""
    return {target.id: names_in(node.value) for node in ast.walk(function) if isinstance(node, ast.Assign)
            for part in node.targets for target in ast.walk(part) if isinstance(target, ast.Name)}


def list_lacking(text: str) -> Iterator[tuple[str, set[str]]]:
    """What each call of ``cached`` keeps, and the variables of its function that its answer has and its key has not.

    What is computed of the key, or of the building that remembers, adds nothing to it.
    """
    for function in (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)):
        made = list_made(function)
        inner = {one.name: one for one in function.body if isinstance(one, ast.FunctionDef)}
        own = {arg.arg for arg in (*function.args.args, *function.args.kwonlyargs)} | made.keys()
        for call in ast.walk(function):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "cached":
                what, _, key, compute = call.args
                told, asked = names_in(key), names_in(compute)
                for _ in made:
                    told |= {name for known in tuple(told) for name in made.get(known, ())}
                told |= names_in(call.func.value)
                for name in asked & inner.keys():
                    asked = asked | names_in(inner[name]) - list_made(inner[name]).keys()
                for _ in made:
                    told |= {name for name, of in made.items() if of & own <= told}
                yield ast.unparse(what), {name for name in asked if name in own or "." in name} - told - {"self"}


def test_each_key_has_all_that_its_answer_is_made_of() -> None:
    found = [(f"{path.name}: {what}", lacking) for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))
             for what, lacking in list_lacking(path.read_text("utf-8"))]
    assert len(found) >= MANY and len(dict(found)) == len(found)
    assert {what: lacking for what, lacking in found if lacking} == {}


def test_a_key_that_is_too_small_is_seen() -> None:
    text = ("def find(world, room, margin):\n    wide = 2 * margin\n"
            "    return world.cached('a', 9, {}, lambda: see(room, wide))")
    assert [dict(list_lacking(text.format(key))) for key in ("room", "(room, margin)", "(room, wide)")] == [
        {"'a'": {"wide"}}, {"'a'": set()}, {"'a'": set()}]


def describe_view(robot: RobotModel, pose: Pose2) -> str:
    """The lines that are expected to be seen from a pose, and from the grid near it."""
    on_grid, _ = _find_visible_on_grid(robot, pose)
    return repr((predict_lines(robot, pose).segments_px.tolist(), on_grid.tolist()))


def test_what_is_seen_from_a_pose_is_so_whatever_was_asked_before() -> None:
    """From another place in the same direction, in another direction from the same place, from another height."""
    def build(high_m: float, world: World) -> RobotModel:
        robot = plain_robot(world)
        return replace(robot, mount=replace(robot.mount, height_m=high_m))

    def read() -> World:
        return read_world(Source.parse(HOUSE, "house.toml"))

    known, seen = read(), list[str]()
    for high_m in (1.0, 1.3):
        for x_m, heading in ((2.0, 0.0), (4.0, 0.0), (2.0, 1.0)):
            pose = to_world(Pose2(x_m, 2.0, heading))
            seen.append(describe_view(build(high_m, known), pose))
            assert seen[-1] == describe_view(build(high_m, read()), pose)
    assert len(set(seen)) == len(seen)
