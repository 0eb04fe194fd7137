"""Laws of the shape of a thing by several sights: the one from clearly nearer tells it, and nothing seen is lost."""

from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.floor import list_corners
from knowledge_sources.methods.floor.footprints import NEARER, ThingShape, join_shapes, take_free
from world_models.frames import Pose2

EYE = np.zeros(2)
NONE = shapely.Polygon()
GRAIN_M2 = 1e-6
FROM_M = st.floats(0.8, 4.0)


def box(x: float, y: float, half_x: float = 0.2, half_y: float = 0.2) -> shapely.Polygon:
    return shapely.box(x - half_x, y - half_y, x + half_x, y + half_y)


@st.composite
def shapes(draw: st.DrawFn, from_m: st.SearchStrategy[float] = FROM_M) -> ThingShape:
    """A thing before the eye."""
    taken = box(
        draw(st.floats(1.0, 3.0)), draw(st.floats(-0.8, 0.8)), draw(st.floats(0.03, 0.3)), draw(st.floats(0.03, 0.4))
    )
    return ThingShape(taken, draw(from_m))


@st.composite
def frees(draw: st.DrawFn) -> shapely.Geometry:
    """Some floor that is seen to be free, or none."""
    return box(draw(st.floats(0.5, 3.0)), draw(st.floats(-1.0, 1.0)), 0.3, 0.3) if draw(st.booleans()) else NONE


def is_within(small: shapely.Geometry, large: shapely.Geometry) -> bool:
    return bool(shapely.difference(small, large).area <= GRAIN_M2)


def is_same(one: ThingShape, other: ThingShape) -> bool:
    return bool(shapely.symmetric_difference(one.taken, other.taken).area <= GRAIN_M2)


@settings(max_examples=60)
@given(shapes(), shapes(), frees())
def test_what_is_seen_now_stays_unless_it_was_seen_from_clearly_nearer(
    known: ThingShape, new: ThingShape, free: shapely.Geometry
) -> None:
    """A shape is known from as near as the nearer sight."""
    joined = join_shapes(known, new, free, EYE)
    if NEARER * new.from_m > known.from_m:
        assert is_same(joined, known) and joined.from_m == known.from_m
    else:
        assert is_within(new.taken, joined.taken)
        assert joined.from_m == min(known.from_m, new.from_m) or new.from_m < NEARER * known.from_m == joined.from_m


@settings(max_examples=60)
@given(shapes(), st.floats(0.1, 0.69), st.floats(1.05, 3.0))
def test_from_clearly_nearer_nothing_is_left_in_its_directions_of_what_was_seen_from_afar(
    new: ThingShape, part: float, wider: float
) -> None:
    """From far away it seemed wider and deeper; what lay in the same directions is told again."""
    middle = shapely.get_coordinates(new.taken)[:4].mean(axis=0)
    behind = shapely.affinity.translate(new.taken, *(0.4 * middle / np.linalg.norm(middle)))
    within = shapely.affinity.scale(behind, 0.5 / wider, 0.5 / wider)
    far = ThingShape(within, new.from_m / part)
    joined = join_shapes(far, new, NONE, EYE)
    assert is_same(joined, new) and joined.from_m == new.from_m


@settings(max_examples=40)
@given(shapes(), st.floats(0.1, 0.69))
def test_what_lies_beside_a_nearer_sight_stays(new: ThingShape, part: float) -> None:
    """Of a thing only one end is seen from near by: the other end is where it was, but for floor that is free."""
    beside = shapely.affinity.translate(new.taken, 0.0, 1.5)
    known = ThingShape(beside, new.from_m / part)
    assert is_within(beside, join_shapes(known, new, NONE, EYE).taken)
    free = shapely.affinity.scale(beside, 2.0, 2.0)
    assert (
        not shapely.intersection(
            join_shapes(known, new, free, EYE).taken, shapely.difference(beside, shapely.convex_hull(new.taken))
        ).area
        > GRAIN_M2
    )


@settings(max_examples=40)
@given(shapes(), frees())
def test_a_sight_without_feet_adds_nothing_in_directions_that_are_known(
    known: ThingShape, free: shapely.Geometry
) -> None:
    """It only takes what is seen to be free; in other directions it adds itself."""
    nearer = shapely.affinity.scale(known.taken, 0.5, 0.5, origin=(0.0, 0.0))
    left = join_shapes(known, ThingShape(nearer, math.inf), free, EYE)
    assert is_same(left, ThingShape(take_free(known.taken, free), known.from_m))
    aside = shapely.affinity.rotate(nearer, 90.0, origin=(0.0, 0.0))
    joined = join_shapes(known, ThingShape(aside, math.inf), NONE, EYE)
    assert is_within(aside, joined.taken) and is_within(known.taken, joined.taken)


@settings(max_examples=40)
@given(shapes(), shapes(), frees(), st.floats(-math.pi, math.pi), st.booleans())
def test_it_does_not_matter_where_north_is_or_which_way_round(
    known: ThingShape, new: ThingShape, free: shapely.Geometry, turn: float, mirror: bool
) -> None:
    pose = Pose2(3.0, -2.0, turn)

    def move_points(points: Floats) -> Floats:
        return np.asarray(pose.apply(points * ((1.0, -1.0) if mirror else (1.0, 1.0))))

    def move(shape: ThingShape) -> ThingShape:
        return ThingShape(shapely.transform(shape.taken, move_points), shape.from_m)

    there = join_shapes(move(known), move(new), shapely.transform(free, move_points), move_points(EYE[None])[0])
    here = move(join_shapes(known, new, free, EYE))
    assert shapely.symmetric_difference(there.taken, here.taken).area <= 1e-5


def test_of_what_is_all_free_nothing_is_left() -> None:
    thing = box(2.0, 0.0)
    assert list_corners(take_free(thing, box(2.0, 0.0, 1.0, 1.0))) == ()
