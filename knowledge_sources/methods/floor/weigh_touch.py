"""What a touch tells of what stands there: where it is, and how far what was known reaches."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor.footprints import Corners, build_polygon, list_corners, may_be_there, place
from world_models.building.building import Building
from world_models.entries import Contact, Obstacle, Place
from world_models.frames import Pose2

TOUCH_MARGIN_M = 0.05  # a wall or thing of the model that is so much further than the robot's rim explains a contact
TOUCHED_SIDE_M = 0.15  # a known obstacle reaches so far behind, and to the sides of, where it was touched


class Touched(NamedTuple):
    """Where something was touched.

    Attributes:
        at: (2,) the point of the robot's rim [m, world].
        out: (2,) from the robot's axis to there, of length 1.
        contact: which tells it.
    """

    at: Floats
    out: Floats
    contact: Contact

    @property
    def across(self) -> Floats:
        """(2,) to the left of ``out``."""
        return np.array([-self.out[1], self.out[0]])

    def build_square(self, side_m: float) -> Corners:
        """The corners of a square behind the point, its near side across the direction [m, world]."""
        half, behind = 0.5 * side_m * self.across, side_m * self.out
        corners = (self.at - half, self.at + half, self.at + half + behind, self.at - half + behind)
        return tuple((float(x), float(y)) for x, y in corners[::-1])


def locate_touch(pose: Pose2, radius_m: float, contact: Contact, turned_rad: float) -> Touched:
    """Where a robot touched that stands at ``pose`` now and has turned by ``turned_rad`` since."""
    ahead = pose.heading_rad - turned_rad + contact.direction_rad
    out = np.array([math.cos(ahead), math.sin(ahead)])
    return Touched(np.array(pose.position) + radius_m * out, out, contact)


def find_touched(known: Mapping[str, Obstacle], touched: Touched, reach_m: float) -> str | None:
    """Which known obstacle may have been touched: the nearest, within reach."""
    at = shapely.Point(touched.at)
    near = [(build_polygon(o.footprint).distance(at), id) for id, o in known.items() if may_be_there(o)]
    distance_m, id = min(near, default=(math.inf, ""))
    return id if distance_m <= reach_m else None


def touch_first(
    world: Building, touched: Touched, locale: str, sigma_m: float, number: int, width_m: float
) -> Obstacle:
    """Something that was not known. How large it is a touch does not tell."""
    contact = touched.contact
    at = Place.of_world(world, locale, float(touched.at[0]), float(touched.at[1]))
    return Obstacle(
        f"{locale}/obstacle-{number}", locale, touched.build_square(width_m), sigma_m, at.x_m, at.y_m, width_m,
        seen_s=contact.when_s, touched_s=contact.when_s, by="touch")


def touch_again(world: Building, touched: Touched, known: Obstacle) -> Obstacle:
    """A known obstacle after it was touched: it reaches to where it was touched."""
    corner, when_s = build_polygon(touched.build_square(TOUCHED_SIDE_M)), touched.contact.when_s
    joined = shapely.convex_hull(shapely.union_all([build_polygon(known.footprint), corner]))
    new = replace(known, footprint=list_corners(joined), seen_s=when_s, touched_s=when_s, status="there")
    return place(world, new, joined)
