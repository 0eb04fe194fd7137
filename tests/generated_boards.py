"""Boards for the laws of knowledge sources: a plain house, a robot in it, and what a law puts there, entry by entry.

The hall is the same left to right, so that a board can be mirrored: :func:`mirrored` is about its middle line.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from hypothesis import strategies as st

from blackboard import (
    Effect,
    Entry,
    Ref,
    Retract,
)
from harvey import testing
from harvey.testing import HALL, house
from knowledge_sources.model.model_reviser import ModelReviser
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import (
    Goal,
    Leg,
    Milestone,
    Obstacle,
    Place,
    PlanSketch,
    Subgoal,
    covariance_tuple,
    diagonal,
)
from world_models.entries.location import Covariance
from world_models.frames import Pose2, flattened

T = TypeVar("T")

LENGTH_M, WIDTH_M = 8.0, 4.0
"""Of the hall; its frame begins in its south-west corner, and is turned in the world."""


class Bench(testing.Bench):
    """A bench on which a law puts also what stands in the house, and what is planned there."""

    def pursue(self, destination: Place | None = None) -> Entry[Goal]:
        """A goal that is pursued."""
        return self.put(Goal(Place(HALL, 1.0, 2.0), destination or Place(HALL, 6.0, 2.0)))

    def sketch(self, *places: Place, goal: Entry[Goal] | None = None, path: tuple[int, ...] = (), at: int = 0,
               verified: bool = True, primitive: bool = True) -> Entry[PlanSketch]:
        """A sketch that leads from place to place, for a goal of its own unless one is given."""
        way = places or (Place(HALL, 1.0, 2.0), Place(HALL, 6.0, 2.0))
        steps = tuple(Subgoal(a, b, primitive) for a, b in pairwise(way))
        served = goal or self.pursue(way[-1])
        return self.put(PlanSketch(served.id, path, HALL, steps, at, verified), served)

    def leg(self, sketch: Entry[PlanSketch], **fields: Any) -> Entry[Leg]:
        """The leg of a sketch's current subgoal, under way."""
        step = sketch.value.current
        assert step is not None
        start, end = (place.in_world(house()) for place in (step.origin, step.destination))
        return self.put(replace(Leg(sketch.id, sketch.value.at, start.x_m, start.y_m, end.x_m, end.y_m,
                                    step.tolerance_m), **fields), sketch)

    def frame(self, locale: str = HALL) -> Entry[LocaleFrame]:
        """The frame of a locale."""
        return next(entry for entry in self.view.all(LocaleFrame) if entry.value.name == locale)

    def stand(self, x_m: float, y_m: float, along_m: float, across_m: float, locale: str = HALL,
              **fields: Any) -> Entry[Obstacle]:
        """Something that stands round a place of a locale, half so long and wide; the locale's frame has it."""
        box = [to_world(Pose2(x_m + i * along_m, y_m + k * across_m, 0.0), locale).position
               for i, k in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        number, corners = 1 + len(self.view.all(Obstacle)), tuple((float(x), float(y)) for x, y in box)
        thing = self.put(Obstacle(f"{locale}/obstacle-{number}", locale, corners, 0.02, x_m, y_m,
                                  2.0 * max(along_m, across_m), **fields))
        self.apply(*self.ask(ModelReviser(), thing) or ())
        return thing

    def await_milestone(self, sketch: str = "", index: int = 0, **fields: Any) -> Entry[Milestone]:
        """A milestone that the robot has yet to turn to, unless ``fields`` say otherwise."""
        return self.put(Milestone(sketch, index, "M of a law", **{"look_heading_rad": 0.0, **fields}))


INEXACT: Mapping[str, Any] = {"expected": (((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),), "displacement_modes": ("wall",),
                              "displacements": ((0.0, 0.0, 0.05, 0.0, 0.0),)}
"""Fields of a milestone whose one line may be displaced by 5 cm."""

motions = st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(0.0, 0.8)), min_size=1, max_size=3)
"""Turns [rad], each with the way after it [m]."""


def go(x: float, y: float, heading: float, step: Pose2) -> tuple[float, float, float]:
    """From a pose by a step of the robot's own frame; the plainest composition."""
    return (x + math.cos(heading) * step.x_m - math.sin(heading) * step.y_m,
            y + math.sin(heading) * step.x_m + math.cos(heading) * step.y_m, heading + step.heading_rad)


def drive(bench: Bench, way: list[tuple[float, float]]) -> None:
    """Motions that are reported and believed."""
    for turn_rad, move_m in way:
        _, report = bench.move(turn_rad, move_m)
        bench.revise(bench.view["Hypothesis-1"], motion=report.id)


def to_world(pose: Pose2, locale: str = HALL) -> Pose2:
    """A pose in a locale's frame as one of the world."""
    return flattened(house().world_from_locale(locale)) @ pose


def mirrored(pose: Pose2) -> Pose2:
    """A pose in the hall's frame, mirrored left to right about its middle line."""
    return Pose2(pose.x_m, WIDTH_M - pose.y_m, -pose.heading_rad)


def mirrored_place(place: Place) -> Place:
    """The same of a place in the hall."""
    heading = place.heading_rad
    return Place(place.locale, place.x_m, WIDTH_M - place.y_m, None if heading is None else -heading)


def mirrored_covariance(covariance: Covariance) -> Covariance:
    """The same of a covariance in the hall's frame."""
    signs = np.diag([1.0, -1.0, -1.0])
    return covariance_tuple(signs @ np.array(covariance) @ signs)


def made(effects: Iterable[Effect] | None, kind: type[T]) -> list[T]:
    """The values of a kind that effects post or revise."""
    return [e.value for e in effects or () if not isinstance(e, Retract) and isinstance(e.value, kind)]


def effect_on(effects: Iterable[Effect] | None, kind: type[Any]) -> Any:
    """The only effect that makes a value of a kind."""
    (found,) = [e for e in effects or () if not isinstance(e, Retract) and isinstance(e.value, kind)]
    return found


def reasons(effect: Effect) -> set[str]:
    """What an effect names, directly: ids of entries, and of its act's other effects the kinds of their values."""
    return set(testing.reasons(effect))


def all_reasons(effects: Sequence[Effect]) -> set[str]:
    """The ids of all entries that the effects of one act name."""
    return {r.id for e in effects for r in e.because if isinstance(r, Entry | Ref)}


poses = st.builds(Pose2, st.floats(0.8, LENGTH_M - 0.8), st.floats(0.8, WIDTH_M - 0.8), st.floats(-3.1, 3.1))
"""Of a robot in the hall's frame, off its walls."""
places = st.builds(Place, st.just(HALL), st.floats(0.8, LENGTH_M - 0.8), st.floats(0.8, WIDTH_M - 0.8))
covariances = st.builds(diagonal, st.floats(0.002, 0.2), st.floats(0.001, 0.2))


def near(*bounds: float) -> st.SearchStrategy[float]:
    """Numbers on either side of a bound and of its opposite: just beyond, well beyond, and half or twice as much."""
    by = (1.0 - 1e-4, 1.0 + 1e-4, 0.9, 1.1, 0.7, 1.4, 0.5, 2.0)
    return st.builds(lambda bound, part, side: bound * part * side, st.sampled_from(bounds), st.sampled_from(by),
                     st.sampled_from((-1.0, 1.0)))
