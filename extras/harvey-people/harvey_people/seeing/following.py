"""Following: constant velocity from sight to sight, sightings given to whom they fit, births and deaths by odds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harvey_people.seeing.mover import MIN_SIGHTS, SLOW_M_PER_S, SURE_LOG_ODDS, Mover
from harvey_people.seeing.sightings import Sighting, is_seen_free
from world_models.entries import FreeFloor

Floats = NDArray[np.float64]
WALK_M_PER_S = 0.8
"""Standard deviation of a velocity along each axis, before anything is known of it: people walk at 0.3 to 1.6."""
TURNS_M2_PER_S3 = 0.3
"""Spectral density of the acceleration: in a second the velocity changes by some 0.5 m/s."""
GATE = 11.8
"""Squared distance, in standard deviations, within which a sighting may be of somebody: 99.7 % of two dimensions."""
PRIOR_LOG_ODDS = 0.0
"""That what is seen for the first time moves: where people are about, as much walks as stands of what a model lacks."""
ELSE_PER_M2 = 0.01
"""Density of sightings that are of something else: one thing on 20 square metres, and one in five times what stood is
out of sight when that comes into it."""
MOST_LOG_RATIO = 3.9
"""One sighting says no more: one in 50 is misread."""
MOST_LOG_ODDS, LEAST_LOG_ODDS = 8.0, -7.0
MAX_UNSEEN_S = 3.0
"""Whom nobody has seen for so long may be anywhere."""
MAX_PASSING_S = 0.8
"""What was seen less than MIN_SIGHTS times is gone where it is not seen again so soon."""
LEAST_STOOD_M = 0.1
"""Where something stands is known no better: from elsewhere another side of it is seen."""


class FollowStep(NamedTuple):
    """What becomes of one mover by one sight of the floor.

    Attributes:
        before: number in the list of those known; None for one that is new.
        mover: after it.
    """

    before: int | None
    mover: Mover


def follow(known: Sequence[Mover], seen: Sequence[Sighting], floor: FreeFloor, numbers: int) -> list[FollowStep]:
    """All movers after one sight of the floor.

    Args:
        numbers: how many movers had a name so far.
    """
    now = [predict(mover, floor.seen_s) for mover in known]
    given = _assign(now, seen)
    steps = [FollowStep(k, _see(mover, seen[given[k]], floor) if k in given else _miss(mover, floor))
             for k, mover in enumerate(now)]
    born = [sighting for j, sighting in enumerate(seen) if j not in given.values()]
    return [*steps, *(FollowStep(None, _begin(f"mover-{numbers + n}", sighting, floor))
                      for n, sighting in enumerate(born, start=1))]


def predict(mover: Mover, at_s: float) -> Mover:
    """The same at a later time, nobody having seen it since."""
    lasts_s = max(0.0, at_s - mover.at_s)
    motion = np.eye(4)
    motion[0, 2] = motion[1, 3] = lasts_s
    noise = TURNS_M2_PER_S3 * np.kron(
        [[lasts_s**3 / 3.0, lasts_s**2 / 2.0], [lasts_s**2 / 2.0, lasts_s]], np.eye(2))
    return _with(mover, motion @ mover.state, motion @ np.array(mover.covariance) @ motion.T + noise, at_s)


def _with(mover: Mover, state: Floats, covariance: Floats, at_s: float) -> Mover:
    x, y, vx, vy = (round(float(value), 4) for value in state)
    rows = tuple(tuple(round(float(value), 6) for value in row) for row in covariance)
    return replace(mover, x_m=x, y_m=y, vx_m_per_s=vx, vy_m_per_s=vy, covariance=rows, at_s=at_s)


def _assign(movers: Sequence[Mover], seen: Sequence[Sighting]) -> dict[int, int]:
    """Which sighting is whose: each mover's by its number, so that all together fit best; none beyond the gate."""
    if not movers or not seen:
        return {}
    from scipy.optimize import linear_sum_assignment  # loaded when somebody is about: most missions see nobody

    far = 1e6
    costs = np.full((len(movers), len(seen)), far)
    for i, mover in enumerate(movers):
        for j, sighting in enumerate(seen):
            distance2, log_density = _fit(mover.state[:2], np.array(mover.covariance)[:2, :2], sighting)
            if distance2 <= GATE:
                costs[i, j] = -log_density
    rows, columns = linear_sum_assignment(costs)
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if costs[i, j] < far}


def _fit(place: Floats, covariance: Floats, sighting: Sighting) -> tuple[float, float]:
    """(squared distance in standard deviations, log density [1/m^2]) of a sighting of something expected there."""
    total, off = covariance + sighting.covariance, sighting.place - place
    distance2 = float(off @ np.linalg.solve(total, off))
    return distance2, -0.5 * distance2 - math.log(math.tau * math.sqrt(float(np.linalg.det(total))))


def _begin(name: str, sighting: Sighting, floor: FreeFloor) -> Mover:
    covariance = np.zeros((4, 4))
    covariance[:2, :2], covariance[2:, 2:] = sighting.covariance, WALK_M_PER_S**2 * np.eye(2)
    x, y = (float(value) for value in sighting.place)
    draft = Mover(name, floor.locale, x, y, 0.0, 0.0, (), round(x, 4), round(y, 4),
                  round(_mean_sigma(sighting), 4), PRIOR_LOG_ODDS, floor.seen_s, floor.seen_s, 1, sighting.words)
    return _with(draft, np.array([x, y, 0.0, 0.0]), covariance, floor.seen_s)


def _see(mover: Mover, sighting: Sighting, floor: FreeFloor) -> Mover:
    """A mover that is seen again: where it is, and whether it rather moves than stands."""
    covariance = np.array(mover.covariance)
    gain = covariance[:, :2] @ np.linalg.inv(covariance[:2, :2] + sighting.covariance)
    state = mover.state + gain @ (sighting.place - mover.state[:2])
    left = np.eye(4) - gain @ np.eye(2, 4)
    updated = left @ covariance @ left.T + gain @ sighting.covariance @ gain.T
    _, moves = _fit(mover.state[:2], covariance[:2, :2], sighting)
    stood = np.array([mover.stood_x_m, mover.stood_y_m])
    _, stands = _fit(stood, mover.stood_sigma_m**2 * np.eye(2), sighting)
    ratio = moves - float(np.logaddexp(stands, math.log(ELSE_PER_M2)))
    odds = mover.log_odds + min(MOST_LOG_RATIO, max(-MOST_LOG_RATIO, ratio))
    odds = min(MOST_LOG_ODDS, max(LEAST_LOG_ODDS, odds))
    seen = replace(_with(mover, state, updated, floor.seen_s), seen_s=floor.seen_s, sights=mover.sights + 1,
                   evidence=sighting.words, log_odds=round(odds, 4))
    return _judge(_settle(seen, sighting))


def _settle(mover: Mover, sighting: Sighting) -> Mover:
    """Where it would be if it stood: the mean of what was seen; of one that surely walks, where it is now."""
    sigma = _mean_sigma(sighting)
    if mover.log_odds >= SURE_LOG_ODDS:
        return replace(mover, stood_x_m=mover.x_m, stood_y_m=mover.y_m, stood_sigma_m=round(sigma, 4))
    weight = mover.stood_sigma_m**2 / (mover.stood_sigma_m**2 + sigma**2)
    x = mover.stood_x_m + weight * (float(sighting.place[0]) - mover.stood_x_m)
    y = mover.stood_y_m + weight * (float(sighting.place[1]) - mover.stood_y_m)
    narrower = max(LEAST_STOOD_M, sigma * math.sqrt(weight))
    return replace(mover, stood_x_m=round(x, 4), stood_y_m=round(y, 4), stood_sigma_m=round(narrower, 4))


def _miss(mover: Mover, floor: FreeFloor) -> Mover:
    """A mover that is not seen: it is gone where its place is seen free, or where nobody has seen it for long."""
    is_free = is_seen_free(floor, mover.state[:2], min(0.5, mover.sigma_m))
    most_s = MAX_UNSEEN_S if mover.sights >= MIN_SIGHTS else MAX_PASSING_S
    is_gone = is_free or floor.seen_s - mover.seen_s > most_s
    return replace(mover, status="gone") if is_gone else _judge(mover)


def _judge(mover: Mover) -> Mover:
    """What surely moves, and is not so slow that it stands."""
    moves = mover.log_odds >= SURE_LOG_ODDS and mover.speed_m_per_s >= SLOW_M_PER_S
    walks = mover.log_odds > 0.0 and mover.speed_m_per_s >= SLOW_M_PER_S and mover.seen_s == mover.at_s
    return replace(mover, status="moves" if moves else "may move", walked_s=mover.at_s if walks else mover.walked_s)


def _mean_sigma(sighting: Sighting) -> float:
    return math.sqrt(0.5 * float(np.trace(sighting.covariance)))
