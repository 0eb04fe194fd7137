"""What something on the floor may be (§4): a thing, a jamb that stands beside, a leaf, or dirt on the lens.

All of them compete for each sight. What nobody has thought of is the rest: by it a sight is a stain, a shade or a
reflection, as likely as its pixels leave open. A model is right to centimetres, and a wall's end that reaches into the
model's opening looks like a thing there: what is seen in the directions of such an end alone may be that end. What
keeps its place in the picture, and would have to move on the floor for that, is before the camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import PRIORS, add_evidence, to_log_odds
from knowledge_sources.methods.floor.footprints import (
    build_polygon,
    cover_directions,
    list_corners,
    measure_width_m,
)
from knowledge_sources.settings import ActionSettings
from world_models.building.building import Building
from world_models.building.locales import Doorway
from world_models.camera import Camera
from world_models.entries import Difference, Evidence, Explanation, FloorThing, Obstacle, Obstruction, RivalKind

BLOCKING: tuple[RivalKind, ...] = ("thing", "leaf", "jamb")
"""What is in the way, whatever it is: of a jamb the wall's end is, and nothing wider."""
STOOD_STILL = 3.0
"""For dirt, and against a thing, by each look in which it had the same pixels and would have moved on the floor: of a
thing two sides or three would each be within 12 of 50 pixels or more by chance."""
CAME_NOW = -3.0
"""For dirt of which no look before shows anything at its pixels: of twenty looks it came in one."""
SEEN_BEFORE = math.log(2.0)
"""Of three things that were seen since the place was sure, one was seen after a kidnap."""
NO_JAMB = -3.0
"""For a jamb where a sight shows what it does not explain."""
MIN_OBSTACLE_CERTAINTY = 0.9  # with this certainty an obstacle is there: by one sure picture, or by two unsure ones
MAX_BESIDE_M = 0.15  # a jamb stands at most so far beside: 10 cm, with its casing
JAMB_OF = "a jamb of "
MIN_EXPLAINED = 0.8  # least part of the directions of a sight that such a jamb explains
MIN_JAMB_SIGMA_M = 0.05  # of a jamb's place: the edge of what is seen may be its casing, or its shade
MIN_LEAF_PART = 0.6  # least part of a door's width that is seen of a leaf
MAX_FIXED_LOOKS = 2  # so many earlier looks tell enough
MAX_ABSENT_LOOKS = 4  # what so many of the last looks do not show at its place was not there
FIXED_PX = 6.0  # sides that are no further apart are one: the floor is looked at every second pixel
BORDER_PX = 4.0  # a side so near to the picture's border tells nothing; nor does the upper one: there the floor ends
MIN_MOVED_M = 0.3  # so far it would have moved on the floor from each look to each other one
MIN_HIDDEN = 0.8  # least part of a box within an obstruction, by which what was seen in it is of that
ROUND_PX = 8.0  # so far round an obstruction it may reach: its outline is not known better

Box = tuple[float, float, float, float]


class JambBeside(NamedTuple):
    """A jamb that stands beside its place in the model, as one sight shows it.

    Attributes:
        door: its name.
        shape: the end of the wall that is seen in the opening [m, world].
        off_m, sigma_m: how far the jamb is displaced along its wall, to the right as seen from the door's first room.
        log_ratio: by how much a jamb explains better than a thing that it is seen there, at an end of the opening.
    """

    door: str
    shape: shapely.Polygon
    off_m: float
    sigma_m: float
    log_ratio: float

    def words(self) -> str:
        return f"{JAMB_OF}{self.door} that stands {abs(100.0 * self.off_m):.0f} cm beside"


class ShownSight(NamedTuple):
    """What a sight shows of something, beside how it looks.

    Attributes:
        jamb: that explains it; None: none does.
        leaf: that explains it, in words; None: none does.
        still: in how many looks before it had the same pixels, and would have moved on the floor for that.
    """

    jamb: JambBeside | None = None
    leaf: str | None = None
    still: int = 0


def explain_sight(p_thing: float, shown: ShownSight, known: Difference, most: float) -> tuple[Explanation, ...]:
    """What each rival makes of a sight.

    Args:
        p_thing: how likely its pixels show something solid.
        most: no thing is more probable than this, so that what is gone is soon forgotten.
    """
    ratio = min(to_log_odds(p_thing), max(to_log_odds(most) - known.odds_of("thing"), 0.0))
    still, jamb, before = STOOD_STILL * shown.still, shown.jamb, known.find("jamb")
    explanations = [Explanation("thing", "a thing", ratio - still),
                    Explanation("dirt", "dirt on the lens", ratio + (still or CAME_NOW))]
    if shown.leaf is not None:
        explanations.append(Explanation("leaf", shown.leaf, ratio - still))
    if jamb is not None:
        explanations.append(Explanation("jamb", jamb.words(), ratio + jamb.log_ratio - still, jamb.off_m, jamb.sigma_m))
    elif before is not None:
        explanations.append(Explanation("jamb", before.what, NO_JAMB, before.off, before.sigma))
    return tuple(explanations)


def explain_free(ratio: float, known: Difference) -> tuple[Explanation, ...]:
    """What each rival makes of floor that is seen free where it should stand: dirt has no opinion."""
    others = (rival for rival in known.rivals if rival.kind in ("leaf", "jamb"))
    return (Explanation("thing", "a thing", ratio),
            *(Explanation(rival.kind, rival.what, ratio, rival.off, rival.sigma) for rival in others))


def explain_touch(leaf: str | None, known: Difference, most: float) -> tuple[Explanation, ...]:
    """What each rival makes of a touch: neither dirt on the lens is touched, nor what stands elsewhere."""
    ratio = max(0.0, to_log_odds(most) - known.odds_of("thing"))
    of_leaf = () if leaf is None else (Explanation("leaf", leaf, ratio),)
    not_here = (Explanation(rival.kind, rival.what, -2.0 * STOOD_STILL - max(0.0, rival.log_odds))
                for rival in known.rivals if rival.kind not in BLOCKING)
    return Explanation("thing", "a thing", ratio), *of_leaf, *not_here


def explain_seen_elsewhere(known: Difference) -> tuple[Explanation, ...]:
    """What a kidnap says of a thing that was seen before it or after: most sights are before it, as the next tells it.
    """
    ratio = known.odds_of("thing") - PRIORS["elsewhere"] - SEEN_BEFORE
    return (Explanation("elsewhere", "a thing that stands elsewhere", ratio),)


def explain_seen_in_patch(looks: int) -> tuple[Explanation, ...]:
    """What each rival makes of a thing that was seen nowhere but where so many looks before showed the same pixels."""
    still = STOOD_STILL * looks
    return Explanation("thing", "a thing", -still), Explanation("dirt", "dirt on the lens", still)


def judge_thing(thing: Obstacle, difference: Difference, settings: ActionSettings) -> Obstacle:
    """A thing as certain as its difference says, that something blocks the way there; gone where nothing may. What was
    held to be there is suspected again where evidence counts against it, and it is not certain.
    """
    p = math.fsum(rival.p for rival in difference.rivals if rival.kind in BLOCKING)
    certainty = min(p, settings.max_obstacle_certainty)
    if certainty < settings.min_gone_certainty:
        return replace(thing, certainty=certainty, status="gone")
    is_held = thing.is_there and difference.find("elsewhere") is None and certainty >= thing.certainty
    is_there = is_held or certainty >= MIN_OBSTACLE_CERTAINTY
    return replace(thing, certainty=certainty, status="there" if is_there else "suspected")


def judge_by(told: Evidence, thing: Obstacle, known: Difference, settings: ActionSettings) -> Obstacle:
    """A thing with one evidence more."""
    difference = add_evidence(known, told)
    evidence = f"{told.shows}: {difference.odds_in_words()}"
    return replace(judge_thing(thing, difference, settings), evidence=evidence)


def tell_of_door(difference: Difference, evidence: Evidence) -> Evidence | None:
    """What evidence of a thing says of the door whose jamb it rather is; None where it is no jamb."""
    jamb = difference.leader
    said = tuple(e for e in evidence.explanations if e.kind == "thing" or (e.kind, e.what) == ("jamb", jamb.what))
    if jamb.kind != "jamb" or len(said) < 2:
        return None
    door = jamb.what.removeprefix(JAMB_OF).partition(" ")[0]
    return replace(evidence, about=door, shows=f"{difference.about} is seen at its end", explanations=said)


def find_jamb_beside(
    world: Building, locale: str, seen: shapely.Polygon, eye: tuple[float, float]
) -> JambBeside | None:
    """The jamb of a door of a room that explains a sight without feet, by that end of its wall alone; None: none does.

    Args:
        seen: what is seen of the thing, on the floor: its foot is no further from the ``eye`` than that.
    """
    ends = [(cover_directions(end, seen, eye), doorway, end) for doorway in world.doorways_of(locale)
            for end in _list_ends(doorway, locale) if not end.buffer(MAX_BESIDE_M).contains(shapely.Point(eye))]
    best = max(ends, key=lambda one: one[0], default=None)
    return _describe(*best[1:], seen, np.array(eye)) if best is not None and best[0] >= MIN_EXPLAINED else None


def find_leaf(world: Building, locale: str, seen: shapely.Polygon, within_m: float) -> str | None:
    """The leaf that explains what is seen of a thing on the floor, in words: it is thin, and as wide as its door; it
    stands in the opening, or is hinged at a jamb.
    """
    width_m = measure_width_m(list_corners(seen) or shapely.get_coordinates(seen)[:-1])
    for doorway in world.doorways_of(locale):
        if not MIN_LEAF_PART * doorway.width_m <= width_m <= doorway.width_m + 2.0 * within_m:
            continue
        opening = shapely.MultiPoint(np.concatenate(doorway.thresholds_world)).convex_hull
        if opening.buffer(within_m).contains(seen):
            return f"the leaf of {doorway.name}, shut"
        jambs = [shapely.Point(jamb) for jamb in doorway.threshold_of(locale)]
        is_thin = seen.area <= 2.0 * within_m * width_m
        if is_thin and min(seen.distance(jamb) for jamb in jambs) <= within_m and any(
                jamb.buffer(doorway.width_m + within_m).contains(seen) for jamb in jambs):
            return f"the leaf of {doorway.name}, which stands open"
    return None


def _describe(doorway: Doorway, end: shapely.Polygon, seen: shapely.Polygon, at: Floats) -> JambBeside:
    shape = _cut_to(end, seen, at)
    left, right = doorway.threshold_of(doorway.between[0])
    along = (shapely.get_coordinates(shape) - left) @ (right - left) / doorway.width_m
    off_m = float(along.max()) if along.mean() < 0.5 * doorway.width_m else float(along.min()) - doorway.width_m
    sigma_m = math.hypot(MIN_JAMB_SIGMA_M, 0.25 * doorway.depth_m)  # on which side of its wall it is seen is not known
    return JambBeside(doorway.name, shape, round(off_m, 3), round(sigma_m, 3),
                      math.log(doorway.width_m / (2.0 * MAX_BESIDE_M)))


def _list_ends(doorway: Doorway, locale: str) -> list[shapely.Polygon]:
    """Both ends of the wall, as far as they may reach into an opening, through the wall."""
    near, far = doorway.threshold_of(locale), doorway.threshold_of(doorway.other(locale))[::-1]
    into = MAX_BESIDE_M / doorway.width_m * (near[1] - near[0])
    return [build_polygon([a, a + step, b + step, b])
            for a, b, step in ((near[0], far[0], into), (near[1], far[1], -into))]


def _cut_to(end: shapely.Polygon, seen: shapely.Polygon, at: Floats) -> shapely.Polygon:
    """The part of a wall's end that lies in the directions of what is seen; all of it where that is nothing."""
    away = shapely.get_coordinates(seen)[:-1] - at
    far_m = 2.0 * float(np.linalg.norm(shapely.get_coordinates(end) - at, axis=1).max())
    rim = at + far_m * away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    part = shapely.intersection(end, build_polygon(np.concatenate([rim, at[None]])))
    return build_polygon(shapely.get_coordinates(end if part.is_empty else part))


def find_fixed(thing: FloorThing, earlier: Iterable[Sequence[FloorThing]], camera: Camera) -> dict[int, Box]:
    """The boxes in earlier looks (the newest first), by their numbers, that show a thing at the same place of the
    picture and elsewhere on the floor.
    """
    found, places, absent = dict[int, Box](), [build_polygon(thing.footprint).centroid], 0
    for number, things in enumerate(earlier):
        alike = [one for one in things if _is_same(one.box_px, thing.box_px, camera)]
        absent += not alike
        for same in alike:
            place = build_polygon(same.footprint).centroid
            if number not in found and min(shapely.distance(place, places)) >= MIN_MOVED_M:
                found[number] = same.box_px
                places.append(place)
        if len(found) == MAX_FIXED_LOOKS or absent == MAX_ABSENT_LOOKS:
            break
    return found


def enclose(boxes: Sequence[Box], known: Obstruction | None) -> Obstruction:
    """The obstruction that takes all of the boxes, and what is known of it."""
    corners = [(u, v) for left, top, right, bottom in boxes for u in (left, right) for v in (top, bottom)]
    whole = build_polygon([*corners, *(() if known is None else known.outline_px)])
    return Obstruction(tuple((float(u), float(v)) for u, v in shapely.get_coordinates(whole)[:-1]))


def is_within(box: Box, patch: Box) -> bool:
    """Whether a box of the picture lies within another, but for its upper side: there the floor ends."""
    left, _, right, bottom = (inner - outer for inner, outer in zip(box, patch, strict=True))
    return left >= -FIXED_PX and max(right, bottom) <= FIXED_PX


def is_behind(box: Box, obstruction: Obstruction) -> bool:
    """Whether a box of the picture lies within what is before the camera."""
    left, top, right, bottom = box
    across = [[(left, top), (right, bottom)], [(left, bottom), (right, top)]]
    return bool(obstruction.hidden_part(across, ROUND_PX).mean() >= MIN_HIDDEN)


def _is_same(box: Box, now: Box, camera: Camera) -> bool:
    """Whether two boxes have all sides in common that tell anything, two at least."""
    off_px = [abs(box[i] - now[i]) for i, end in ((0, camera.width), (2, camera.width), (3, camera.height))
              if BORDER_PX < now[i] < end - BORDER_PX]
    return len(off_px) >= 2 and max(off_px) <= FIXED_PX
