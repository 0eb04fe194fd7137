"""Sightings: what one picture or one reading of the ring shows on the floor, and the static world does not explain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.entries import FreeFloor

Floats = NDArray[np.float64]
SIDE_M = 0.2
"""Only a side of it is seen: its middle is unknown to this, along each axis (half the depth and width of a person)."""
MIN_P = 0.5
"""A thing in a picture that is less probable is no sighting."""
APART_M = 0.5
"""Feet in a picture that are nearer to one another are of one person."""
MAX_REACH_M = 5.0
"""Further away a cone of the ring is wider than a way is long."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """Something seen or heard on the floor.

    Attributes:
        place: (2,) [m, world]; covariance: (2, 2).
        words: what showed it.
    """

    place: Floats
    covariance: Floats
    words: str


def list_sightings(floor: FreeFloor) -> list[Sighting]:
    """All in one sight of the floor; by pictures from their feet on the floor, by the ring from its echoes."""
    return list(_in_picture(floor) if floor.sense == "camera" else _in_ring(floor))


def _in_picture(floor: FreeFloor) -> Iterator[Sighting]:
    seen: list[tuple[Floats, float]] = []
    for thing in floor.things:
        middle = np.mean(thing.footprint, axis=0)
        near = next((k for k, (other, _) in enumerate(seen) if np.linalg.norm(other - middle) < APART_M), None)
        if thing.p_thing >= MIN_P and near is None:
            seen.append((middle, thing.sigma_m))
        elif thing.p_thing >= MIN_P and near is not None:
            seen[near] = 0.5 * (seen[near][0] + middle), max(seen[near][1], thing.sigma_m)
    for middle, sigma_m in seen:
        yield Sighting(middle, (sigma_m**2 + SIDE_M**2) * np.eye(2), "feet on the floor of a picture")


def _in_ring(floor: FreeFloor) -> Iterator[Sighting]:
    """One for each run of neighbouring directions that end in something which the model lacks."""
    far = np.array(floor.far_m)
    is_thing = np.array([end == "thing" for end in floor.ends]) & (far < MAX_REACH_M)
    for run in _find_runs(is_thing, far):
        bearing = floor.bearings_rad[run[0]] + 0.5 * _turn(floor, run[0], run[-1])
        away_m = float(far[run].min()) + SIDE_M / 2.0
        across_m = away_m * max(_turn(floor, run[0], run[-1]), 0.05) / math.sqrt(12.0)
        ahead = np.array([math.cos(bearing), math.sin(bearing)])
        aside = np.array([-ahead[1], ahead[0]])
        sigma_m = float(np.array(floor.sigma_m)[run].max())
        along = (sigma_m**2 + SIDE_M**2) * np.outer(ahead, ahead)
        across = (across_m**2 + SIDE_M**2) * np.outer(aside, aside)
        yield Sighting(np.array([floor.x_m, floor.y_m]) + away_m * ahead, along + across, "echoes of the ring")


def _find_runs(is_thing: NDArray[np.bool_], far: Floats) -> Iterator[list[int]]:
    """Runs of directions round the circle; the last direction of a full circle is the first one again."""
    count = len(is_thing) - 1
    if count < 2 or not is_thing.any():
        return
    begin = next((k for k in range(count) if not is_thing[k]), 0)
    run: list[int] = []
    for k in (*((begin + step) % count for step in range(count)), -1):
        joins = k >= 0 and is_thing[k] and (not run or abs(far[k] - far[run[-1]]) < 2.0 * SIDE_M)
        if run and not joins:
            yield run
            run = []
        if k >= 0 and is_thing[k]:
            run.append(k)


def _turn(floor: FreeFloor, first: int, last: int) -> float:
    """From one direction counter-clockwise to another [rad]."""
    return (floor.bearings_rad[last] - floor.bearings_rad[first]) % math.tau


def is_seen_free(floor: FreeFloor, place: Floats, margin_m: float) -> bool:
    """Whether a place (2,) [m, world] is seen to be free floor, by a margin on either side."""
    if not floor.bearings_rad:
        return False
    off = place - (floor.x_m, floor.y_m)
    bearings = np.array(floor.bearings_rad)
    apart = np.abs(np.remainder(bearings - math.atan2(off[1], off[0]) + math.pi, math.tau) - math.pi)
    k, away_m = int(np.argmin(apart)), float(np.hypot(*off))
    step = float(np.median(np.diff(bearings))) if len(bearings) > 1 else 0.0
    return bool(apart[k] <= step and floor.near_m[k] <= away_m - margin_m and away_m + margin_m < floor.far_m[k])
