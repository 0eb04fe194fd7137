"""Meeting: where on a move the robot may come to meet somebody, how probably; by predicted places and their doubt.

The expected harm of a move is that of the floor ahead (:mod:`knowledge_sources.methods.motion.clearance`): the sum of
p u^2, where u is the speed at which a touch would happen. Of a person who comes, only the robot's own part of that
counts: where somebody is to be touched in a direction that is off the robot's way by the angle a, u is v cos a, and
behind its middle nothing. So with v the speed of the move, p is the mean of cos^2 a over the touches.

A touch happens where the robot's rim and a person come nearer to one another: through each part of the rim, in each
moment, as often as the density of the person's place there times the speed at which they come nearer. That speed is the
mean of those who may be there. To it belongs who is there already as the move begins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harvey_people.seeing.following import TURNS_M2_PER_S3
from harvey_people.seeing.mover import Mover
from knowledge_sources.methods.belief import to_probability
from knowledge_sources.methods.motion import Clearance, limit_speed
from world_models.actuator import ActuatorModel
from world_models.frames import Pose2

Floats = NDArray[np.float64]
PERSON_M = 0.3
"""A person's legs and arms reach so far from the middle."""
THINKS_S = 0.3
"""Until a move begins that is decided now; people walk meanwhile."""
FORESEEN_S = 1.2
"""So long a move is looked at; what comes later is decided later: no move takes longer."""
STEP_S = 0.2
"""Of the moments that are asked after."""
ROUND = 24
"""Directions round the robot that are asked after."""
LEAST_P = 1e-9
PARTS = (1.0, 0.75, 0.5, 0.25)
"""Of the robot's speed, that are tried."""


class Move(NamedTuple):
    """A motion of the robot as it is foreseen.

    Attributes:
        places: (n, 2) where it is [m, world]; velocities: (n, 2) of these moments [m/s].
        at_s: (n,) these, STEP_S apart, by the body's clock.
        reach_m: from how far it touches a person's middle.
        speed_m_per_s: by which harm is counted; None: each touch counts, also one that the robot's motion is none of.
    """

    places: Floats
    velocities: Floats
    at_s: Floats
    reach_m: float
    speed_m_per_s: float | None

    def weigh(self, velocities: Floats, ways: Floats) -> Floats:
        """(..., k) how much a touch counts in directions (k, 2), at velocities (..., 2)."""
        own = np.maximum(0.0, velocities @ ways.T)
        return np.ones_like(own) if self.speed_m_per_s is None else np.asarray((own / self.speed_m_per_s) ** 2)


def plan_straight(here: Pose2, heading_rad: float, move_m: float, radius_m: float, speed_m_per_s: float,
                  begins_s: float) -> Move:
    """A move straight ahead that begins at a moment."""
    rolls_s = np.arange(0.0, move_m / speed_m_per_s + STEP_S, STEP_S)
    ahead = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    places = here.position + np.minimum(rolls_s * speed_m_per_s, move_m)[:, None] * ahead
    velocities = np.repeat(speed_m_per_s * ahead[None], len(rolls_s), axis=0)
    return Move(places, velocities, begins_s + rolls_s, radius_m + PERSON_M, speed_m_per_s)


def plan_beside(here: Pose2, aim: tuple[float, float], along_rad: float, lasts_s: float, radius_m: float,
                speed_m_per_s: float, now_s: float, begins_s: float) -> Move:
    """To stand until a moment, then a move to a point, and on along a line; for so long. Each touch on it counts."""
    to_aim, along = np.array(aim) - here.position, np.array([math.cos(along_rad), math.sin(along_rad)])
    away_m = float(np.hypot(*to_aim))
    at_s = np.arange(0.0, lasts_s + STEP_S, STEP_S)
    rolls_m = np.maximum(0.0, at_s - (begins_s - now_s)) * speed_m_per_s
    first, then = np.minimum(rolls_m, away_m), np.maximum(0.0, rolls_m - away_m)
    ahead = to_aim / max(away_m, 1e-9)
    places = here.position + first[:, None] * ahead + then[:, None] * along
    velocities = np.where((rolls_m < away_m)[:, None], ahead, along) * speed_m_per_s * (rolls_m > 0.0)[:, None]
    return Move(places, velocities, now_s + at_s, radius_m + PERSON_M, None)


def measure_meeting(movers: Sequence[Mover], move: Move) -> tuple[Clearance, tuple[float, ...]]:
    """Where on a move somebody may be met, and how probably; and that of each mover, over the whole move."""
    gone = np.hypot(*np.diff(move.places, axis=0).T)
    at_m = np.concatenate([[0.0], np.cumsum(gone)])
    each = np.array([_meets(mover, move) for mover in movers]).reshape(len(movers), -1)
    either = 1.0 - np.prod(1.0 - each, axis=0)
    clearance = Clearance(at_m, np.maximum(either, LEAST_P), math.inf)
    return clearance, tuple(round(float(p.max(initial=0.0)), 4) for p in each)


@cache
def _disc(reach_m: float) -> tuple[Floats, Floats]:
    """((k, 2) places within reach, evenly spread; (k, 2) their directions)."""
    rings, angles = (np.arange(5) + 0.5) / 5.0 * reach_m, (np.arange(ROUND) + 0.5) / ROUND * math.tau
    r, a = (grid.ravel() for grid in np.meshgrid(rings, angles))
    out = np.stack([np.cos(a), np.sin(a)], axis=1)
    return r[:, None] * out, out


def _meets(mover: Mover, move: Move) -> Floats:
    """(n,) how probably somebody who moves is met up to each moment of a move, as harm counts it."""
    mean, covariance, velocity, follows = foresee(mover, move.at_s - mover.at_s)
    inside, ways = _disc(move.reach_m)
    area = np.hypot(*inside.T) * (move.reach_m / 5.0) * (math.tau / ROUND)
    harm = move.weigh(move.velocities[0], ways)
    there = float(_density(mean[:1], covariance[:1], move.places[:1, None] + inside)[0] @ (area * harm))
    angles = (np.arange(ROUND) + 0.5) / ROUND * math.tau
    out = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rim = move.places[:, None] + move.reach_m * out
    moving = velocity + np.einsum("nij,nkj->nki", follows, rim - mean[:, None])
    nearer = np.maximum(0.0, np.einsum("nki,ki->nk", move.velocities[:, None] - moving, out))
    harms = move.weigh(move.velocities, out)
    each = np.sum(_density(mean, covariance, rim) * nearer * harms, axis=1) * move.reach_m * math.tau / ROUND
    came = np.concatenate([[0.0], np.cumsum(0.5 * (each[1:] + each[:-1]) * STEP_S)])
    return np.asarray(to_probability(mover.log_odds) * np.minimum(1.0, there + came))


def _density(mean: Floats, covariance: Floats, places: Floats) -> Floats:
    """(n, k) the density [1/m^2] of places (n, 2) with covariances (n, 2, 2) at places (n, k, 2)."""
    off, inverse = places - mean[:, None], np.linalg.inv(covariance)
    away2 = np.einsum("nki,nij,nkj->nk", off, inverse, off)
    return np.asarray(np.exp(-0.5 * away2) / (math.tau * np.sqrt(np.linalg.det(covariance)))[:, None])


def foresee(mover: Mover, ahead_s: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The place of somebody so long (n,) after the moment of what is known.

    Returns (n, 2) places, their covariances (n, 2, 2), the velocity (2,), and by how much that is larger where the
    place is off (n, 2, 2) [1/s].
    """
    t = np.maximum(ahead_s, 0.0)[:, None, None]
    known = np.array(mover.covariance)
    place, both, velocity = known[:2, :2], known[:2, 2:], known[2:, 2:]
    covariance = place + t * (both + both.T) + t**2 * velocity + TURNS_M2_PER_S3 * t**3 / 3.0 * np.eye(2)
    together = both.T + t * velocity + TURNS_M2_PER_S3 * t**2 / 2.0 * np.eye(2)
    return (mover.state[:2] + t[:, 0] * mover.state[2:], covariance, mover.state[2:],
            together @ np.linalg.inv(covariance))


def find_speed(movers: Sequence[Mover], here: Pose2, heading_rad: float, radius_m: float, actuator: ActuatorModel,
               begins_s: float, borne: float) -> float:
    """The highest speed that is tried at which the expected harm of going there is borne; 0 where none is [m/s].

    Args:
        begins_s: when the move begins, by the body's clock.
        borne: speed at which a certain touch is borne: that of creeping over floor that nobody has seen [m/s].
    """
    for part in PARTS:
        speed = round(part * actuator.speed_m_per_s, 4)
        move_m = speed * FORESEEN_S
        clearance, _ = measure_meeting(
            movers, plan_straight(here, heading_rad, move_m, radius_m, speed, begins_s))
        if limit_speed(clearance, 0.0, move_m, actuator, borne) >= speed:
            return speed
    return 0.0
