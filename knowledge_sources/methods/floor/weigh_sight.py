"""What one sight of the floor tells of the things on it, and of those that were known: found, seen again, or gone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.belief import add_evidence, to_log_odds
from knowledge_sources.methods.floor.floor_map import BEAM_RAD
from knowledge_sources.methods.floor.footprints import (
    OBSTACLE_DEPTH_M,
    ThingShape,
    build_free_floor,
    build_polygon,
    deepen,
    find_before,
    find_open_floor,
    find_room,
    find_same,
    join_shapes,
    list_corners,
    may_be_there,
    measure_change_m,
    measure_free_part,
    place,
    take_free,
)
from knowledge_sources.methods.floor.ranges import MAX_RANGE_THING_M
from knowledge_sources.methods.floor.rivals_on_floor import (
    MIN_MOVED_M,
    Box,
    ShownSight,
    explain_free,
    explain_seen_in_patch,
    explain_sight,
    find_fixed,
    find_jamb_beside,
    find_leaf,
    is_within,
    judge_thing,
)
from knowledge_sources.methods.floor.see_floor import FLOOR_VIEW_DISTANCE_M, MAX_P_SEEN_ONCE
from knowledge_sources.methods.floor.weigh_touch import TOUCH_MARGIN_M
from knowledge_sources.settings import ActionSettings, Settings
from world_models.building.building import Building
from world_models.camera import Camera
from world_models.entries import Difference, Evidence, Explanation, FloorThing, FreeFloor, Obstacle

MIN_THING_CERTAINTY = 0.5  # what is seen on the floor with less certainty than this tells of no obstacle
MIN_FREE_PART = 0.5  # part of where an obstacle may stand that must be seen free to tell that it is not there any more
MAX_SHARED_PART = 0.25  # where a thing that is seen takes more of that, the rest seen free tells nothing of it
FREE_FLOOR_ODDS = (1.0 - MAX_P_SEEN_ONCE) / MAX_P_SEEN_ONCE
"""Odds of an obstacle that is there while all of its footprint is seen free: a picture unsays what a picture said."""
LOOKS_FREE_ODDS = 0.2  # the same where the floor there looks free, and nothing else tells
CAMOUFLAGED_FREE_ODDS = 0.3  # the same of one that looks like the floor
MIN_WAY_M = FLOOR_VIEW_DISTANCE_M / 2.0  # what is seen, or missed, from nearer by is no further evidence
MAX_OBSTACLE_SIGMA_M = 0.25
"""What is seen on the floor with a larger standard deviation is waited for until it is nearer."""
MAX_HULL_PART = 1.5  # two sights are of one thing where the hull round both is at most so much larger than both
MAX_VAGUER = 2.0  # a sight that is less sure by this factor of where a thing is tells only its directions
MIN_PART_UNEXPLAINED = 0.3  # of a thing that was not known: what walls and things of the model do not explain
SEEN_AGAIN_S = 2.0  # what tells nothing new is noted again after so long


class Sight(NamedTuple):
    """A sight of the floor, and what it is weighed by.

    Attributes:
        floor: the sight.
        seen_by: id of the picture or of the reading.
        world: the building as it is known.
        under: the floor that the robot stands on [m, world].
        camera: by which it was seen.
        before: the things in earlier pictures, the newest first.
        differences: what is known of things, by their names.
    """

    floor: FreeFloor
    seen_by: str
    world: Building
    under: shapely.Polygon
    camera: Camera
    before: Sequence[Sequence[FloorThing]] = ()
    differences: Mapping[str, Difference] = MappingProxyType({})

    @property
    def eye(self) -> tuple[float, float]:
        return self.floor.x_m, self.floor.y_m

    def know(self, about: str) -> Difference:
        """What is known of a thing."""
        return self.differences.get(about, Difference.unknown(about))

    def is_from_elsewhere(self, known: Obstacle) -> bool:
        """Whether the eye is where none was at any evidence of an obstacle that counts: this is further evidence."""
        eyes = ((one.x_m, one.y_m) for one in self.know(known.name).counted if one.apart_m)
        return all(math.dist(self.eye, eye) >= MIN_WAY_M for eye in eyes)

    def is_surer(self, thing: FloorThing, known: Obstacle) -> bool:
        """Whether this sight alone is surer of a thing than all before."""
        rival = self.know(known.name).find("thing")
        return rival is None or to_log_odds(thing.p_thing) > rival.log_odds + 1e-6

    def is_dirt(self, known: Obstacle) -> bool:
        """Whether it was taken back as dirt; what else is gone, and is seen again, is another thing."""
        dirt = self.know(known.name).find("dirt")
        return dirt is not None and dirt.p > 0.5

    def tell(
        self, about: str, shows: str, explanations: tuple[Explanation, ...], apart_m: float = MIN_WAY_M
    ) -> Evidence:
        """Evidence of something on the floor."""
        f = self.floor
        return Evidence(about, shows, explanations, f.x_m, f.y_m, 0.0, apart_m, math.tau, f.seen_s)

    def weigh(self, told: Evidence) -> Difference:
        """What is known of something with what is told now."""
        return add_evidence(self.know(told.about), told)


class Sighted(NamedTuple):
    """What is known of one obstacle after a sight.

    Attributes:
        known: id under which it was known; None where it is new.
        told: the evidence of the sight; None where that is no further evidence.
    """

    known: str | None
    obstacle: Obstacle
    told: Evidence | None = None


def is_telling(thing: FloorThing) -> bool:
    """Whether a thing in a sight is certain and sharp enough to conclude anything from."""
    return thing.p_thing >= MIN_THING_CERTAINTY and thing.sigma_m <= MAX_OBSTACLE_SIGMA_M


def weigh_sight(sight: Sight, known: Mapping[str, Obstacle], settings: Settings) -> Iterator[Sighted]:
    """What a sight tells of each thing in it, and of each obstacle whose floor it shows.

    Args:
        known: what is known on the floor, by id.
    """
    f, s = sight.floor, settings.action
    free = shapely.union(sight.under, build_free_floor(
        f.x_m, f.y_m, f.bearings_rad, f.near_m, np.subtract(f.far_m, f.sigma_m).tolist()))
    confirmed = free if f.sense == "ranges" else shapely.Polygon()  # where a camouflaged thing would be seen
    if f.confirmed_m:
        confirmed = build_free_floor(f.x_m, f.y_m, f.bearings_rad, f.near_m,
                                np.minimum(f.confirmed_m, np.subtract(f.far_m, f.sigma_m)).tolist())
    drafts: dict[str, Sighted] = {}
    patches: list[Box] = []
    fresh = 0
    for thing in f.things:
        if not is_telling(thing):
            continue
        new = _shape_of(sight, thing)
        rest = {id: o for id, o in known.items() if id not in drafts and (may_be_there(o) or sight.is_dirt(o))}
        whole = math.inf if f.sense == "ranges" else MAX_HULL_PART  # any thing in the cone of an echo may be heard
        seen = build_polygon(thing.footprint)
        id = find_before(rest, seen, sight.eye, settings.plan.overhang_m) if thing.is_cut else None
        shown = _show(sight, thing)
        if shown.jamb is not None and thing.is_cut and id is None:  # before anything wider is believed
            beside = shown.jamb.shape
            new = ThingShape(beside, float(beside.distance(shapely.Point(sight.eye))))
        shape = new.taken
        id = id or find_same(rest, shape, thing.sigma_m, whole)
        if id is not None:
            again = see_again(sight, known[id], thing, new, shown, free, s)
            if again is not None:
                drafts[id] = again._replace(known=id)
                patches += _list_patches(sight, thing, shown, again)
            continue
        joined = [build_polygon(draft.obstacle.footprint) for draft in drafts.values()]
        if any(shapely.intersection(polygon, shape).area > 0.5 * shape.area for polygon in joined):
            continue  # another part of what was joined already
        if shown.jamb is None and _is_explained(sight, thing, shape):
            continue
        found = see_first(sight, thing, new, shown, 1 + len(known) + fresh, s)
        if found is not None:
            fresh += 1
            drafts[f"new {fresh}"] = found
            patches += _list_patches(sight, thing, shown, found)
    for id, obstacle in known.items():
        lost = lose_to_patch(sight, obstacle, patches, s) if id not in drafts and may_be_there(obstacle) else None
        if lost is not None:
            drafts[id] = lost._replace(known=id)
    yield from drafts.values()
    seen = shapely.union_all([build_polygon(thing.footprint).buffer(2.0 * thing.sigma_m) for thing in f.things])
    for id, obstacle in known.items():
        if id in drafts or not may_be_there(obstacle):
            continue
        shared = measure_free_part(where_it_may_stand(sight, obstacle), seen)
        if sight.is_from_elsewhere(obstacle) and shared <= MAX_SHARED_PART:
            is_told = not obstacle.is_camouflaged and obstacle.by != "ranges"  # from the floor, by its looks
            gone = miss(sight, obstacle, free if is_told else confirmed, confirmed, s)
            if gone is not None:
                yield gone._replace(known=id)


def _list_patches(sight: Sight, thing: FloorThing, shown: ShownSight, found: Sighted) -> list[Box]:
    """The pixels of what stood still in the picture, where that is dirt by what is known with this sight."""
    is_dirt = shown.still and found.told is not None and sight.weigh(found.told).leader.kind == "dirt"
    return [thing.box_px] if is_dirt else []


def lose_to_patch(sight: Sight, known: Obstacle, patches: Sequence[Box], settings: ActionSettings) -> Sighted | None:
    """A known obstacle that was seen nowhere but at pixels that dirt turns out to take: it explains those sights, too.
    """
    polygon = build_polygon(known.footprint)
    boxes = [one.box_px for things in sight.before for one in things
             if build_polygon(one.footprint).intersects(polygon)]
    if known.by != "camera" or known.touched_s is not None or not boxes or not all(
            any(is_within(box, patch) for patch in patches) for box in boxes):
        return None
    told = sight.tell(known.name, "its pixels stay while the robot moves", explain_seen_in_patch(1), MIN_MOVED_M)
    difference = sight.weigh(told)
    evidence = f"{sight.seen_by}: {told.shows}: {difference.odds_in_words()}"
    return Sighted(None, replace(judge_thing(known, difference, settings), evidence=evidence), told)


def _show(sight: Sight, thing: FloorThing) -> ShownSight:
    """What a sight shows of a thing, beside how it looks."""
    if sight.floor.sense != "camera":
        return ShownSight()
    within_m, seen = 2.0 * thing.sigma_m, build_polygon(thing.footprint)
    jamb = find_jamb_beside(sight.world, sight.floor.locale, seen, sight.eye) if thing.is_cut else None
    leaf = None if thing.is_cut else find_leaf(sight.world, sight.floor.locale, seen, within_m)
    return ShownSight(jamb, leaf, len(find_fixed(thing, sight.before, sight.camera)))


def _shape_of(sight: Sight, thing: FloorThing) -> ThingShape:
    """What a sight shows of a thing, as deep as is assumed: where its feet are not seen, the map says what is free."""
    taken = deepen(thing.footprint, sight.eye, OBSTACLE_DEPTH_M)
    return ThingShape(taken, math.inf if thing.is_cut else float(taken.distance(shapely.Point(sight.eye))))


def _is_explained(sight: Sight, thing: FloorThing, shape: shapely.Polygon) -> bool:
    """Whether walls and things of the model may be all that is seen."""
    locale = find_room(sight.world, shape, sight.floor.locale)
    unexplained = shapely.intersection(shape, find_open_floor(sight.world, locale, TOUCH_MARGIN_M + thing.sigma_m))
    return bool(unexplained.area < MIN_PART_UNEXPLAINED * shape.area)


def see_first(
    sight: Sight, thing: FloorThing, shape: ThingShape, shown: ShownSight, number: int, settings: ActionSettings
) -> Sighted | None:
    """A thing that was not known; None where it stands on no floor."""
    f, world = sight.floor, sight.world
    locale = find_room(world, shape.taken, f.locale)
    own = shapely.intersection(shape.taken, find_open_floor(world, locale, 0.0))
    footprint = list_corners(own)
    if not footprint:
        return None
    name = f"{locale}/obstacle-{number}"
    told = _explain(sight, name, thing, shown, settings)
    difference = sight.weigh(told)
    found = Obstacle(
        name, locale, footprint, thing.sigma_m, 0.0, 0.0, 0.0, thing.height_m, thing.sigma_height_m, 0.0, f.seen_s,
        None, f.sense, _tell(thing, sight, difference), "suspected", thing.is_camouflaged, shape.from_m)
    return Sighted(None, judge_thing(place(world, found, own), difference, settings), told)


def _explain(sight: Sight, name: str, thing: FloorThing, shown: ShownSight, settings: ActionSettings) -> Evidence:
    """What a sight of a thing says of it. Where it is dirt, what it shows further on is no further evidence."""
    explanations = explain_sight(thing.p_thing, shown, sight.know(name), settings.max_obstacle_certainty)
    return sight.tell(name, thing.evidence, explanations, MIN_MOVED_M if shown.still else MIN_WAY_M)


def see_again(
    sight: Sight, known: Obstacle, thing: FloorThing, shape: ThingShape, shown: ShownSight, free: shapely.Geometry,
    settings: ActionSettings,
) -> Sighted | None:
    """A known obstacle after it was seen once more; None where that tells nothing that matters.

    What deceives the eye once does so again from the same place: only another sight is further evidence.
    """
    s, f, world = settings, sight.floor, sight.world
    is_further = sight.is_from_elsewhere(known) or sight.is_surer(thing, known)
    told = _explain(sight, known.name, thing, shown, s) if is_further else None
    difference = sight.know(known.name) if told is None else sight.weigh(told)
    judged = known if told is None else judge_thing(known, difference, s)
    is_vague = thing.sigma_m > MAX_VAGUER * known.sigma_m
    joined = _join_sight(sight, known, shape._replace(from_m=math.inf) if is_vague else shape, free)
    footprint = list_corners(joined.taken)
    moved = measure_change_m(known.footprint, footprint) >= s.min_footprint_change_m
    surer = abs(judged.certainty - known.certainty) > 0.005 or judged.status != known.status
    higher = thing.sigma_height_m < 0.7 * known.sigma_height_m
    if not (moved or surer or higher or f.seen_s - known.seen_s >= SEEN_AGAIN_S):
        return None
    height, sigma = (thing.height_m, thing.sigma_height_m) if higher else (known.height_m, known.sigma_height_m)
    new = replace(judged, seen_s=f.seen_s, height_m=height, sigma_height_m=sigma,
                  sigma_m=min(known.sigma_m, thing.sigma_m), evidence=_tell(thing, sight, difference),
                  is_camouflaged=known.is_camouflaged and thing.is_camouflaged)
    if moved and footprint:
        new = place(world, replace(new, footprint=footprint, seen_from_m=joined.from_m), joined.taken)
    return Sighted(None, new, told)


def _join_sight(sight: Sight, known: Obstacle, new: ThingShape, free: shapely.Geometry) -> ThingShape:
    """The shape of a known obstacle after it was seen once more; what was touched no picture takes back."""
    f, old = sight.floor, ThingShape.of(known)
    if known.status == "gone":
        joined = new
    elif f.sense == "ranges":  # nor how wide it is
        joined = old._replace(taken=take_free(old.taken, free))
    else:
        joined = join_shapes(old, new, free, np.array(sight.eye))
    if known.touched_s is not None:
        joined = joined._replace(taken=shapely.union(joined.taken, old.taken))
    own = shapely.intersection(joined.taken, find_open_floor(sight.world, known.locale, 0.0))
    return joined if own.is_empty else joined._replace(taken=own)


def where_it_may_stand(sight: Sight, known: Obstacle) -> shapely.Geometry:
    """Where a known obstacle may stand: as far round what was seen of it as its doubt reaches, or an echo's cone."""
    heard_m = min(known.seen_from_m, MAX_RANGE_THING_M) if known.by == "ranges" else 0.0
    doubt_m = max(2.0 * known.sigma_m, math.tan(0.5 * BEAM_RAD) * heard_m)
    grown = build_polygon(known.footprint).buffer(doubt_m)
    own = shapely.intersection(grown, find_open_floor(sight.world, known.locale, TOUCH_MARGIN_M))
    return grown if own.is_empty else own


def miss(
    sight: Sight, known: Obstacle, free: shapely.Geometry, confirmed: shapely.Geometry, settings: ActionSettings
) -> Sighted | None:
    """A known obstacle after its floor, or some of it, was seen free; None where that tells nothing.

    Args:
        confirmed: where it would be seen to stand, whatever it looks like.
    """
    where = where_it_may_stand(sight, known)
    likeliest = build_polygon(known.footprint)
    free_part = min(measure_free_part(part, free) for part in (likeliest, where))
    if free_part >= MIN_FREE_PART:
        looks = FREE_FLOOR_ODDS if measure_free_part(where, confirmed) >= MIN_FREE_PART else LOOKS_FREE_ODDS
        odds = CAMOUFLAGED_FREE_ODDS if known.is_camouflaged else looks
        explanations = explain_free(math.log1p(free_part * (odds - 1.0)), sight.know(known.name))
        told = sight.tell(known.name, f"{free_part:.0%} of the floor where it may stand is seen free", explanations)
        return Sighted(None, judge_thing(known, sight.weigh(told), settings), told)
    left = take_free(likeliest, shapely.buffer(free, -known.sigma_m))  # as far as its edges are known
    footprint = list_corners(left)
    if not footprint or measure_change_m(known.footprint, footprint) < settings.min_footprint_change_m:
        return None
    return Sighted(None, place(sight.world, replace(known, footprint=footprint), left))


def _tell(thing: FloorThing, sight: Sight, difference: Difference) -> str:
    """Which pixels of which picture tell of a thing, and what it may be."""
    left, top, right, bottom = thing.box_px
    pixels = f", pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})" if sight.floor.sense == "camera" else ""
    return f"{sight.seen_by}{pixels}: {thing.evidence}: {difference.odds_in_words()}"
