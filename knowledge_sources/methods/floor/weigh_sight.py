"""What one sight of the floor tells of the things on it, and of those that were known: found, seen again, or gone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.belief.odds import to_log_odds, update
from knowledge_sources.methods.floor.door_beside import find_jamb_beside
from knowledge_sources.methods.floor.found_things import (
    find_before,
    find_open_floor,
    find_room,
    find_same,
    keep_touched,
    may_be_there,
    place,
    tell_status,
    weigh_footprints,
    with_core,
)
from knowledge_sources.methods.floor.see_floor import FLOOR_VIEW_DISTANCE_M
from knowledge_sources.methods.floor.weigh_touch import TOUCH_MARGIN_M
from knowledge_sources.methods.motion.footprints import (
    build_free_floor,
    build_polygon,
    deepen,
    list_corners,
    measure_change_m,
    measure_free_part,
    take_free,
)
from knowledge_sources.settings import ActionSettings, Settings
from world_models.building.building import Building
from world_models.entries.floor import FloorThing, FreeFloor
from world_models.entries.obstacle import Obstacle, ObstacleStatus

MIN_FREE_PART = 0.5  # part of an obstacle's footprint that must be seen free to tell that it is not there any more
MAX_SHARED_PART = 0.25  # where a thing that is seen takes more of the footprint, the rest seen free tells nothing of it
FREE_FLOOR_ODDS = 0.03  # odds of an obstacle that is there while all of its footprint is seen free
ALIKE_FREE_ODDS = 0.3  # the same of one that looks like the floor
MIN_EVIDENCE_INTERVAL_S = 0.3  # pictures that follow each other faster are no further evidence of an obstacle
MAX_OBSTACLE_SIGMA_M = 0.25
"""What is seen on the floor with a larger standard deviation is waited for until it is nearer."""
MAX_HULL_PART = 1.5  # two sights are of one thing where the hull round both is at most so much larger than both
OBSTACLE_DEPTH_M = 0.3  # depth that something is taken to have of which only the near side is seen
MIN_PART_UNEXPLAINED = 0.3  # of a thing that was not known: what walls and things of the model do not explain
SEEN_AGAIN_S = 2.0  # what tells nothing new is noted again after so long


class Sight(NamedTuple):
    """A sight of the floor, and what it is weighed by.

    Attributes:
        floor: the sight.
        told_by: id of the picture or of the reading.
        world: the building as it is known.
        rim_m: to here from the eye a thing may reach whose feet are not seen.
        known_free: the floor that was known to be free before [m, world].
        ahead: what the robot sweeps next on its way [m, world].
    """

    floor: FreeFloor
    told_by: str
    world: Building
    rim_m: float
    known_free: shapely.Geometry
    ahead: shapely.Geometry

    @property
    def eye(self) -> tuple[float, float]:
        return self.floor.x_m, self.floor.y_m


class Sighted(NamedTuple):
    """What is known of one obstacle after a sight.

    Attributes:
        known: id under which it was known; None where it is new.
        is_next: whether it counts as there because it stands on the robot's way.
    """

    known: str | None
    obstacle: Obstacle
    is_next: bool = False


def is_telling(thing: FloorThing, settings: ActionSettings) -> bool:
    """Whether a thing in a sight is certain and sharp enough to conclude anything from."""
    return thing.p_thing >= settings.min_thing_certainty and thing.sigma_m <= MAX_OBSTACLE_SIGMA_M


def weigh_sight(
    sight: Sight, known: Mapping[str, Obstacle], ways_m: Mapping[str, float], settings: Settings
) -> Iterator[Sighted]:
    """What a sight tells of each thing in it, and of each obstacle whose floor it shows.

    Args:
        known: what is known on the floor, by id.
        ways_m: how far the eye is from where each was seen last; infinite where that is forgotten.
    """
    f, s = sight.floor, settings.action
    free = build_free_floor(f.x_m, f.y_m, f.bearings_rad, f.near_m, np.subtract(f.far_m, f.sigma_m).tolist())
    told = free if f.sense == "ranges" else shapely.Polygon()  # where what looks like the floor would be seen to stand
    if f.told_m:
        told = build_free_floor(f.x_m, f.y_m, f.bearings_rad, f.near_m,
                                np.minimum(f.told_m, np.subtract(f.far_m, f.sigma_m)).tolist())
    drafts: dict[str, Sighted] = {}
    fresh = 0
    for thing in f.things:
        if not is_telling(thing, s):
            continue
        core = deepen(thing.footprint, sight.eye, OBSTACLE_DEPTH_M)
        rest, whole = {id: o for id, o in known.items() if id not in drafts}, MAX_HULL_PART
        if f.sense == "ranges":  # an echo tells how far a thing is, not where in its cone: any in it may be heard
            rest, whole = {id: o for id, o in rest.items() if may_be_there(o)}, math.inf
        id = find_before(rest, core, sight.eye, settings.plan.overhang_m) if thing.is_cut else None
        jamb = find_jamb_beside(sight.world, f.locale, core, sight.eye) if thing.is_cut and id is None else None
        shape = core
        if jamb is not None:  # a door that is a little beside, before anything wider is believed
            shape = core = jamb.shape
            thing = replace(thing, evidence=f"{thing.evidence}, as a jamb of {jamb.door} that stands beside would")
        elif thing.is_cut:
            shape = _reach_to_rim(sight, core)
        id = id or find_same(rest, shape, thing.sigma_m, whole)
        if id is not None:
            new = see_again(sight, known[id], ways_m[id], thing, shape, free, s)
            if new is not None:
                drafts[id] = Sighted(id, with_core(new, keep_touched(known[id], core)))
            continue
        again = [build_polygon(draft.obstacle.footprint) for draft in drafts.values()]
        if any(shapely.intersection(polygon, shape).area > 0.5 * shape.area for polygon in again):
            continue  # another part of what was joined already
        if jamb is None and _is_explained(sight, thing, shape):
            continue
        found = see_first(sight, thing, shape, 1 + len(known) + fresh, s)
        if found is not None:
            fresh += 1
            drafts[f"new {fresh}"] = Sighted(None, with_core(found, core))
    for draft in drafts.values():
        yield _hold_next(draft, sight.ahead)
    seen = shapely.union_all([build_polygon(thing.footprint).buffer(2.0 * thing.sigma_m) for thing in f.things])
    for id, obstacle in known.items():
        if id in drafts or not may_be_there(obstacle):
            continue
        if measure_free_part(obstacle.footprint, seen) <= MAX_SHARED_PART:
            gone = miss(sight.world, obstacle, told if obstacle.is_alike else free, f.seen_s, s)
            if gone is not None:
                yield Sighted(id, gone)


def _hold_next(draft: Sighted, ahead: shapely.Geometry) -> Sighted:
    """What is suspected next on the way counts as there."""
    if draft.obstacle.status == "suspected" and build_polygon(draft.obstacle.footprint).intersects(ahead):
        return Sighted(draft.known, replace(draft.obstacle, status="there"), is_next=True)
    return draft


def _reach_to_rim(sight: Sight, shape: shapely.Polygon) -> shapely.Polygon:
    """What a thing whose feet are not seen may take: from the robot's rim on, but for floor that is known free."""
    away = shapely.get_coordinates(shape)[:-1] - sight.eye
    rim = sight.eye + sight.rim_m * away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    whole = build_polygon(np.concatenate([shapely.get_coordinates(shape), rim]))
    unseen = shapely.get_parts(shapely.difference(whole, sight.known_free))
    largest = max(unseen, key=lambda part: part.area, default=shapely.Polygon())
    return build_polygon(shapely.get_coordinates(shapely.union(shape, largest)))


def _is_explained(sight: Sight, thing: FloorThing, shape: shapely.Polygon) -> bool:
    """Whether walls and things of the model may be all that is seen."""
    locale = find_room(sight.world, shape, sight.floor.locale)
    unexplained = shapely.intersection(shape, find_open_floor(sight.world, locale, TOUCH_MARGIN_M + thing.sigma_m))
    return bool(unexplained.area < MIN_PART_UNEXPLAINED * shape.area)


def see_first(
    sight: Sight, thing: FloorThing, shape: shapely.Polygon, number: int, settings: ActionSettings
) -> Obstacle | None:
    """A thing that was not known; None where it stands on no floor."""
    f, world = sight.floor, sight.world
    locale = find_room(world, shape, f.locale)
    own = shapely.intersection(shape, find_open_floor(world, locale, 0.0))
    footprint = list_corners(own)
    if not footprint:
        return None
    found = Obstacle(
        f"{locale}/obstacle-{number}", locale, footprint, thing.sigma_m, 0.0, 0.0, 0.0, thing.height_m,
        thing.sigma_height_m, min(thing.p_thing, settings.max_obstacle_certainty), f.seen_s, f.seen_s, None, f.sense,
        _tell(thing, sight), tell_status(thing.p_thing, settings), is_alike=thing.is_alike)
    return place(world, found, own)


def see_again(
    sight: Sight, known: Obstacle, way_m: float, thing: FloorThing, shape: shapely.Polygon, free: shapely.Geometry,
    settings: ActionSettings,
) -> Obstacle | None:
    """A known obstacle after it was seen once more; None where that tells nothing that matters.

    What deceives the eye once does so again from the same place: only another sight is further evidence.
    """
    s, f, world = settings, sight.floor, sight.world
    certainty = max(known.certainty, thing.p_thing)
    if known.status == "gone":
        certainty = thing.p_thing
    elif way_m >= FLOOR_VIEW_DISTANCE_M / 2.0:
        certainty = update(known.certainty, to_log_odds(min(thing.p_thing, s.max_obstacle_certainty)))
    certainty = min(certainty, s.max_obstacle_certainty)
    own = shapely.intersection(shape, find_open_floor(world, known.locale, 0.0))
    polygon = build_polygon(known.footprint)
    if f.sense == "ranges" and known.status != "gone":  # nor how wide it is
        joined = take_free(polygon, free)
    else:
        joined = weigh_footprints(
            polygon, shape if own.is_empty else own, free, known.sigma_m, thing.sigma_m, np.array(sight.eye))
    footprint = list_corners(joined)
    moved = measure_change_m(known.footprint, footprint) >= s.min_footprint_change_m
    surer = certainty > known.certainty + 0.005 or tell_status(certainty, s) != known.status
    higher = thing.sigma_height_m < 0.7 * known.sigma_height_m
    if not (moved or surer or higher or f.seen_s - known.seen_s >= SEEN_AGAIN_S):
        return None
    height, sigma = (thing.height_m, thing.sigma_height_m) if higher else (known.height_m, known.sigma_height_m)
    status: ObstacleStatus = "there" if known.is_there else tell_status(certainty, s)
    new = replace(known, certainty=certainty, seen_s=f.seen_s, looked_s=f.seen_s, status=status, height_m=height,
                  sigma_height_m=sigma, sigma_m=min(known.sigma_m, thing.sigma_m), evidence=_tell(thing, sight),
                  is_alike=known.is_alike and thing.is_alike)
    return place(world, replace(new, footprint=footprint), joined) if moved and footprint else new


def miss(
    world: Building, known: Obstacle, free: shapely.Geometry, seen_s: float, settings: ActionSettings
) -> Obstacle | None:
    """A known obstacle after its floor, or some of it, was seen free; None where that tells nothing."""
    if seen_s - known.looked_s < MIN_EVIDENCE_INTERVAL_S:
        return None
    free_part = measure_free_part(known.footprint, free)
    if free_part >= MIN_FREE_PART:
        odds = ALIKE_FREE_ODDS if known.is_alike else FREE_FLOOR_ODDS
        certainty = update(known.certainty, free_part * math.log(odds))
        status: ObstacleStatus = "gone" if certainty < settings.min_gone_certainty else known.status
        return replace(known, certainty=certainty, looked_s=seen_s, status=status)
    left = take_free(build_polygon(known.footprint), free)
    footprint = list_corners(left)
    if not footprint or measure_change_m(known.footprint, footprint) < settings.min_footprint_change_m:
        return None
    return place(world, replace(known, footprint=footprint, looked_s=seen_s), left)


def _tell(thing: FloorThing, sight: Sight) -> str:
    """Which pixels of which picture tell of a thing."""
    if sight.floor.sense != "camera":
        return f"{sight.told_by}: {thing.evidence}"
    left, top, right, bottom = thing.box_px
    return f"{sight.told_by}, pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f}): {thing.evidence}"
