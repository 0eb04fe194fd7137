"""Checks of a scenario against its building: names are known, and what is put somewhere has room there."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sim.body.building import Building
from sim.body.collision import ROBOT_RADIUS_M
from sim.faults.fault import Fault
from sim.moved_things import belongs_to, move_things
from sim.scenario import Scenario
from world_models.building.geometry.faces import Face
from world_models.building.geometry.outlines import inside_polygon
from world_models.building.world import World
from world_models.commands import parse_destination
from world_models.entries.location import Place
from world_models.files.toml.settings import suggest_keys
from world_models.units import FOOT_M

MAX_OUTSIDE_M = 0.15
"""A thing on a wall may reach this far out of its locale's outline [m]."""


def find_named_locales(scenario: Scenario, world: World) -> list[str]:
    """The locales that a scenario's faults name, and those where it is asked to go on the way."""
    asked = [parse_destination(telling.goal, world).locale for telling in scenario.told if telling.goal]
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
    scenario: Scenario, world: World, start: Place, building: Building, on_floor: Callable[[float], Building]
) -> None:
    """Check that the robot has room at the start and where a fault puts it. Raises ScenarioError."""
    _check_place(scenario, ("goal",), "start", world, start, building)
    for i, fault in enumerate(scenario.faults):
        there = fault.destination
        if there is not None:
            storey = on_floor(world.floor_m(there.locale))
            _check_place(scenario, ("faults", i, "to_locale"), "place", world, there, storey)


def _check_place(
    scenario: Scenario, key: tuple[str | int, ...], what: str, world: World, place: Place, building: Building
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
