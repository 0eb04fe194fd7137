"""Laws of tables: every key of every table moves the field that it names, in its unit, and no other.

And what the field then does is what its name says: of faults, each number by what happens to the body.
"""

from __future__ import annotations

import math
import re
from dataclasses import fields
from typing import Any

import pytest

from box_rooms import box_room
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import Helper, SimulatedBuilding
from sim.faults.built_in_faults import Bump, Kidnap
from sim.faults.fault import Fault, FaultSchedule
from sim.faults.fault_registry import BUILT_IN
from sim.ground_truth.things import MovedThing
from sim.scenario import FORMAT
from world_models.camera import Camera, CameraMount
from world_models.files.toml.settings_reader import known_keys, read_settings
from world_models.files.toml.source import Source, WorldError
from world_models.frames import Pose2

TABLES: dict[str, type[Any]] = {**FORMAT.tables, **FORMAT.inner, "moved": MovedThing, "rides": Helper}
FAULTS = {f"faults {kind.kind}": kind for kind in BUILT_IN}
UNITS = {"m": {"cm": 0.01, "ft": 0.3048, "in": 0.0254}, "rad": {"deg": math.pi / 180.0}}
"""What may be written for a unit, and how much of it that is; not taken from the code."""
NEEDED = {"moved": {"thing": "a"}}
CAMERA = Camera.from_field_of_view(math.radians(65.0), 64, 64)
BUILDING = SimulatedBuilding.of_faces(box_room(), samples=1)
START = Pose2(1.0, 2.0, 0.5)


def read(table: str, kind: type[Any], **values: object) -> Any:
    """One table as its class; None where the values are refused."""
    needed = NEEDED.get(table, {})
    if any(key.startswith("to_") for key in values):
        needed = {"to_locale": "hall"}
    lines = [f"{key} = {str(value).lower() if isinstance(value, bool) else repr(value)}"
             for key, value in {**needed, **values}.items()]
    try:
        return read_settings(Source.parse("\n".join(lines)).root, kind)
    except WorldError:
        return None


def find_field(kind: type[Any], key: str) -> tuple[str, float]:
    """The field that a key names, and its unit in the field's: by the words of the key alone."""
    names = {f.name for f in fields(kind)}
    if key in names:
        return key, 1.0
    for unit, others in UNITS.items():
        for other, factor in others.items():
            named = re.sub(rf"_{other}(?=_|$)", f"_{unit}", key)
            if named in names and named != key:
                return named, factor
    raise AssertionError(f"{key} names no field of {kind.__name__}")


@pytest.mark.parametrize(("table", "kind"), [*TABLES.items(), *FAULTS.items()], ids=[*TABLES, *FAULTS])
def test_every_key_moves_the_field_that_it_names_in_its_unit(table: str, kind: type[Any]) -> None:
    plain = read(table, kind)
    moved = 0
    for key in known_keys(kind):
        name, factor = find_field(kind, key)
        before = getattr(plain, name)
        if isinstance(before, str):
            tries: list[Any] = ["b", "on", "off", "asked"]
        elif isinstance(before, bool):
            tries = [not before]
        elif isinstance(before, int):
            tries = [before + 1, before - 1, before * 2, max(before // 2, 1), 4]
        elif isinstance(before, tuple):
            tries = [[0.01, 0.02, 0.0, 0.0]]
        else:
            near = (before or 0.0) / factor
            tries = [near * 1.05, near * 0.95, 0.31 / factor, 0.05 / factor, 0.001 / factor, 2.0 / factor]
        changed = [(value, found) for value in tries if (found := read(table, kind, **{key: value})) is not None
                   and getattr(found, name) != before]
        if not changed:
            assert isinstance(before, str | tuple), f"no value of {table} {key} is taken"
            continue
        value, found = changed[0]
        wanted = tuple(value) if isinstance(value, list) else value
        is_number = isinstance(before, float) and not isinstance(before, bool)
        assert getattr(found, name) == (pytest.approx(value * factor, rel=1e-12) if is_number else wanted)
        others = {f.name for f in fields(kind)} - {name, "to_locale"}
        assert all(getattr(found, other) == getattr(plain, other) for other in others), f"{key} moves another field"
        moved += 1
    assert moved >= 0.6 * len(known_keys(kind))


def body(*faults: Fault, seed: int = 4) -> SimulatedBody:
    return SimulatedBody(BUILDING, START, CAMERA, CameraMount(1.0), seed=seed, faults=faults)


@pytest.mark.parametrize("kind", [Bump, Kidnap])
@pytest.mark.parametrize(("values", "moved"), [
    ({"forward_m": 0.3}, (0.3, 0.0, 0.0)), ({"forward_m": -0.2}, (-0.2, 0.0, 0.0)),
    ({"left_m": 0.3}, (0.0, 0.3, 0.0)), ({"left_m": -0.2}, (0.0, -0.2, 0.0)),
    ({"turn_rad": 0.4}, (0.0, 0.0, 0.4)), ({"turn_rad": -0.4}, (0.0, 0.0, -0.4)),
    ({"forward_m": 0.1, "left_m": -0.3, "turn_rad": 0.2}, (0.1, -0.3, 0.2)),
])
def test_a_displacement_is_in_the_robots_frame(
    kind: type[Bump], values: dict[str, float], moved: tuple[float, float, float]
) -> None:
    robot = body()
    kind(**values).apply(robot)
    found = START.inverse() @ robot.truth.world_from_robot
    assert (found.x_m, found.y_m, found.heading_rad) == pytest.approx(moved, abs=1e-9)


def test_a_random_displacement_is_as_far_as_it_says_and_depends_on_the_seed() -> None:
    ends = []
    for seed in range(6):
        robot = body(seed=seed)
        Bump(distance_m=0.25, turn_rad=0.1).apply(robot)
        found = START.inverse() @ robot.truth.world_from_robot
        assert math.hypot(found.x_m, found.y_m) == pytest.approx(0.25, abs=1e-9)
        assert abs(found.heading_rad) == pytest.approx(0.1, abs=1e-9)
        ends.append((found.x_m, found.y_m))
    assert len(set(ends)) == 6


@pytest.mark.parametrize("fault_class", BUILT_IN)
def test_a_fault_strikes_at_its_bounds_and_not_before(fault_class: type[Fault]) -> None:
    """Path, time and locale, each just below and at the bound."""
    fault = fault_class("hall", after_m=1.0, after_s=2.0)
    for path_m, time_s, locale, strikes in (
        (1.0, 2.0, "hall", True), (0.99, 2.0, "hall", False), (1.0, 1.99, "hall", False), (1.0, 2.0, "lab", False),
    ):
        schedule = FaultSchedule.of((fault,)).advance(time_s, path_m, locale)
        assert (schedule.take_due("hall")[0] == (fault,)) is strikes


@pytest.mark.parametrize("what", ["picture", "wheels", "put down", "ranges"])
def test_noise_depends_on_its_seed_and_on_nothing_else(what: str) -> None:
    """Eight seeds give eight noises of each kind; the same seed gives the same."""
    from sim.body.senses import RangeRing
    from world_models.entries import MotorCommand

    def draw(seed: int) -> object:
        robot = SimulatedBody(BUILDING, START, CAMERA, CameraMount(1.0), seed=seed, ranges=RangeRing(8),
                              put_down_sigma_m=0.05 * (what == "put down"))
        if what == "picture":
            return robot.look().jpeg
        if what == "wheels":
            robot.execute(MotorCommand(0.3, 0.5))
        return robot.ranges() if what == "ranges" else robot.truth.world_from_robot

    drawn = [draw(seed) for seed in range(8)]
    assert all(one != other for i, one in enumerate(drawn) for other in drawn[:i])
    assert [draw(seed) for seed in range(8)] == drawn
