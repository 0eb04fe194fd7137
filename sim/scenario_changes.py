"""A scenario against its building: names are known, things have room, and its ``[truth]`` gives changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from sim.body.collision import ROBOT_RADIUS_M
from sim.body.simulated_building import SimulatedBuilding
from sim.faults.fault import Fault
from sim.ground_truth.inexact import EXACT, displace
from sim.ground_truth.table import ExtraThing, TrueDoor, TrueThing, TrueWall
from sim.ground_truth.things import MovedThing, belongs_to, build_thing, displace_faces, footprint, move_things
from sim.ground_truth.true_changes import TrueChange, build_leaf, compare_faces
from sim.scenario import Scenario
from world_models.building.geometry.faces import Face
from world_models.building.geometry.outlines import inside_polygon
from world_models.building.locales import Doorway
from world_models.building.world import World
from world_models.commands import parse_destination
from world_models.entries import GO_ON, Place
from world_models.files.toml.settings_reader import suggest_keys
from world_models.files.world_files import WorldError, load_world
from world_models.units import FOOT_M


def find_named_locales(scenario: Scenario, world: World) -> list[str]:
    """The locales that a scenario's faults name, and those where it is asked to go on the way."""
    asked = [parse_destination(one.goal, world).locale for one in scenario.told if one.goal not in ("", GO_ON)]
    return [*(name for fault in scenario.faults for _, name in _locale_keys(fault)), *asked]


def _locale_keys(fault: Fault) -> list[tuple[str, str]]:
    """The locales that a fault names, as (key, locale)."""
    named = [("in_locale", fault.in_locale)]
    if fault.destination is not None:
        named.append(("to_locale", fault.destination.locale))
    return [(key, name) for key, name in named if name]


def check_names(scenario: Scenario, world: World) -> None:
    """Check the locales and rides that faults and helpers name. Raises ScenarioError for an unknown one."""
    for i, fault in enumerate(scenario.faults):
        for key, name in _locale_keys(fault):
            if name not in world.frames:
                near = suggest_keys(name, world.frames)
                raise scenario.refused(("faults", i, key), f"expected {near}, got {name!r}")
    for i, telling in enumerate(scenario.told):
        if why := telling.find_fault(world):
            raise scenario.refused(("told", i, "goal" if telling.goal else "what"), why)
    if not scenario.rides:
        return
    rides = {link.name: link.between for link in world.links if link.kind == "elevator"}
    landings = sorted({name for between in rides.values() for name in between})
    for i, helper in enumerate(scenario.rides):
        for key, name, known in (("passage", helper.passage, list(rides)), ("presses", helper.presses, landings)):
            if name and name not in known:
                raise scenario.refused(("rides", i, key), f"expected {suggest_keys(name, known)}, got {name!r}")


def move_scenario_things(scenario: Scenario, world: World, faces: Sequence[Face]) -> Sequence[Face]:
    """The faces of a building with the scenario's ``[[moved]]`` things in their new places.

    Raises:
        ScenarioError: there is no such thing, or it was moved out of its locale.
    """
    for i, moved in enumerate(scenario.moved):
        try:
            faces = move_things(faces, [moved])
        except ValueError as error:
            raise scenario.refused(("moved", i, "thing"), str(error)) from None
        locale = next(face.locale for face in faces if belongs_to(face, moved))
        corners = np.concatenate([face.polygon_world[:, :2] for face in faces if belongs_to(face, moved)])
        if not all(inside_polygon(corner, world.outline(locale), MAX_OUTSIDE_M) for corner in corners):
            raise scenario.refused(("moved", i), f"expected {moved.thing} to stay within {locale}, got it moved out of"
                                   f" it, by x {moved.x_m:g} m and y {moved.y_m:g} m")
    return faces


def check_room(
    scenario: Scenario, world: World, start: Place, building: SimulatedBuilding,
    on_floor: Callable[[float], SimulatedBuilding],
) -> None:
    """Check that the robot has room at the start and where a fault puts it. Raises ScenarioError."""
    _check_place(scenario, ("goal",), "start", world, start, building)
    for i, fault in enumerate(scenario.faults):
        there = fault.destination
        if there is not None:
            storey = on_floor(world.floor_m(there.locale))
            _check_place(scenario, ("faults", i, "to_locale"), "place", world, there, storey)


def _check_place(
    scenario: Scenario, key: tuple[str | int, ...], what: str, world: World, place: Place, building: SimulatedBuilding
) -> None:
    locale = world.locale(place.locale)
    if not locale.contains((place.x_m, place.y_m)):
        (x0, y0), (x1, y1) = locale.outline.min(axis=0) / FOOT_M, locale.outline.max(axis=0) / FOOT_M
        reach = f"which reaches from ({x0:.1f}, {y0:.1f}) to ({x1:.1f}, {y1:.1f}) ft"
        got = f"({place.x_m / FOOT_M:g}, {place.y_m / FOOT_M:g}) ft"
        raise scenario.refused(key, f"expected a {what} within {place.locale}, {reach}, got {got}")
    room_m = ROBOT_RADIUS_M + building.obstacles.clearance_m(place.in_world(world))
    if room_m < ROBOT_RADIUS_M:
        raise scenario.refused(key, f"expected {ROBOT_RADIUS_M} m of room at the {what}, got {room_m:.2f} m")


MAX_OUTSIDE_M = 0.15
"""A thing, also one on a wall, may reach this far out of its room's outline [m]."""


def load_true_world(scenario: Scenario, opened: tuple[str, ...] = ()) -> World:
    """The building with its details, as inexactly as its model describes it. Raises WorldError."""
    inexact = scenario.truth.inexact
    altered = None if inexact == EXACT else lambda spec: displace(spec, inexact).spec
    return load_world(scenario.world, details=scenario.details, opened=opened, altered=altered)


def find_changed_locales(scenario: Scenario, world: World) -> list[str]:
    """The locales whose doors or things differ. Raises ScenarioError for an unknown one."""
    rooms = [extra.locale for extra in scenario.truth.extra]
    for i, name in enumerate(rooms):
        if name not in world.frames or not world.is_room(name):
            near = suggest_keys(name, world.rooms)
            raise scenario.refused(("truth", "extra", i, "locale"), f"expected a room, {near}, got {name!r}")
    open_doors = {doorway.name: doorway for doorway in world.doorways} if scenario.truth.doors else {}
    return [*rooms, *(locale for door in scenario.truth.doors if door.name in open_doors
                      for locale in open_doors[door.name].between)]


def find_changes(scenario: Scenario, world: World, around: str, faces: Sequence[Face]) -> tuple[TrueChange, ...]:
    """The changes of a building with these faces, those of a locale (``around``), in the order of the file.

    Raises:
        ScenarioError: there is no such door, thing, wall or room, or something has no room where it is put.
    """
    truth = scenario.truth
    open_doors = {doorway.name: doorway for doorway in world.doorways} if truth.doors else {}
    return (
        *(_change_door(scenario, i, door, open_doors, world, around) for i, door in enumerate(truth.doors)),
        *(_change_thing(scenario, i, thing, world, faces) for i, thing in enumerate(truth.things)),
        *(_change_wall(scenario, i, wall, faces) for i, wall in enumerate(truth.walls)),
        *(_add_thing(scenario, i, extra, world) for i, extra in enumerate(truth.extra)),
    )


def _change_door(
    scenario: Scenario, i: int, door: TrueDoor, open_doors: dict[str, Doorway], world: World, around: str
) -> TrueChange:
    doorway = open_doors.get(door.name)
    if doorway is None:
        return _open_door(scenario, i, door, open_doors, world, around)
    if door.into not in ("", *doorway.between):
        raise scenario.refused(("truth", "doors", i, "into"),
                               f"expected {suggest_keys(door.into, doorway.between)}, got {door.into!r}")
    is_open = door.state == "open"
    floor_m = world.floor_m(door.into or doorway.between[0])
    return TrueChange(door, f"door {door.name}", added=() if is_open else build_leaf(door, doorway, floor_m))


def _open_door(
    scenario: Scenario, i: int, door: TrueDoor, open_doors: dict[str, Doorway], world: World, around: str
) -> TrueChange:
    """A door that the model has closed, and that is truly open."""
    if door.state != "open":
        raise scenario.refused(("truth", "doors", i, "name"), "expected a door that is open in the model, "
                               f"{suggest_keys(door.name, open_doors)}, got {door.name!r}")
    try:
        opened = load_true_world(scenario, opened=(door.name,))
    except WorldError as error:
        raise scenario.refused(("truth", "doors", i, "name"), str(error)) from None
    if door.name not in [doorway.name for doorway in opened.doorways]:
        raise scenario.refused(("truth", "doors", i, "name"),
                               f"expected a door that can be open, got {door.name!r}: the rooms do not meet there")
    return compare_faces(door, f"door {door.name}", world.faces_within(around), opened.faces_within(around))


def _change_thing(scenario: Scenario, i: int, thing: TrueThing, world: World, faces: Sequence[Face]) -> TrueChange:
    own = [face for face in faces if belongs_to(face, MovedThing(thing.thing))]
    if not own:
        near = suggest_keys(thing.thing, [known.name for known in world.things])
        raise scenario.refused(("truth", "things", i, "thing"),
                               f"expected a thing of the building, {near}, got {thing.thing!r}")
    there = () if thing.missing else displace_faces(own, thing.x_m, thing.y_m, thing.heading_rad)
    for face in there:
        _check_within(scenario, ("truth", "things", i), thing.thing, face.polygon_world[:, :2], world, face.locale)
    return TrueChange(thing, f"thing {thing.thing}", frozenset(face.name for face in own), there)


def _change_wall(scenario: Scenario, i: int, wall: TrueWall, faces: Sequence[Face]) -> TrueChange:
    """A wall with all that belongs to it; doorways in it have no surface, and stay."""
    walls = [face.name for face in faces if _is_wall(face)]
    if wall.wall not in walls:
        raise scenario.refused(("truth", "walls", i, "wall"),
                               f"expected a wall of the building, {suggest_keys(wall.wall, walls)}, got {wall.wall!r}")
    own = [face for face in faces if face.kind == "barrier" and wall.wall in (face.name, face.parent)]
    there = () if wall.missing else displace_faces(own, wall.x_m, wall.y_m)
    return TrueChange(wall, f"wall {wall.wall}", frozenset(face.name for face in own), there)


def _is_wall(face: Face) -> bool:
    """Whether it is a whole side of a room."""
    return face.kind == "barrier" and face.parent is None and face.name.endswith("-wall")


def _add_thing(scenario: Scenario, i: int, extra: ExtraThing, world: World) -> TrueChange:
    place = Place(extra.locale, extra.x_m, extra.y_m, extra.heading_rad).in_world(world)
    world_from_thing = place.lifted(world.floor_m(extra.locale))
    turn = np.array([[math.cos(place.heading_rad), math.sin(place.heading_rad)],
                     [-math.sin(place.heading_rad), math.cos(place.heading_rad)]])
    corners = footprint(extra.kind) @ turn + place.position
    _check_within(scenario, ("truth", "extra", i), f"the {extra.kind}", corners, world, extra.locale)
    name = f"{extra.locale}/extra-{i}-{extra.kind}"
    return TrueChange(extra, name, added=build_thing(
        extra.kind, name, extra.locale, world_from_thing, extra.colour))


def _check_within(
    scenario: Scenario, key: tuple[str | int, ...], what: str, corners_world: np.ndarray, world: World, locale: str
) -> None:
    outline = world.outline(locale)
    if not all(inside_polygon(corner, outline, MAX_OUTSIDE_M) for corner in corners_world):
        (x0, y0), (x1, y1) = corners_world.min(axis=0), corners_world.max(axis=0)
        reach = f"from ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m in the world"
        raise scenario.refused(key, f"expected {what} to stand within {locale}, got it {reach}")
