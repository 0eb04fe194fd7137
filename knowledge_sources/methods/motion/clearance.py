"""Clearance: where on the way a touch may happen, how probably; and the speed that follows, by one formula (§5).

A robot at speed v that brakes with the deceleration a, after a latency t, meets what stands s ahead at a speed u, with
u^2 = v^2 - 2 a max(0, s - v t). Where something stands there with probability p, the expected harm of that touch goes
with p u^2. It stays below b^2, where b is the speed at which a certain touch is borne. So::

    v <= max(b / sqrt(p), sqrt(a^2 t^2 + 2 a s + b^2 / p) - a t)

What certainly stands near lets the robot creep at b; from where nothing may stand within the stopping distance, it
drives at full speed; all else lies between. A move that was commanded is not braked for what stands within it: there
s counts as 0. So a way over free floor, and then into floor that is not known, is divided where that takes the least
time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats
from world_models.actuator import ActuatorModel

LATENCY_S = 0.2  # from what the robot learns to when it brakes
END_M = 0.05  # so far behind where a touch may happen it no longer does
MIN_MOVE_M = 0.05  # shortest move, but for what is left of one


class Clearance(NamedTuple):
    """How far the way ahead is free, and how surely.

    Attributes:
        at_m: (n,) where on the way the robot would touch what may stand there; rising.
        p: (n,) probability that something does.
        room_m: further it does not go: something was concluded to stand there, or was touched.
    """

    at_m: Floats
    p: Floats
    room_m: float

    @property
    def free_m(self) -> float:
        """How far until floor begins of which nothing is known, or on which something stands."""
        return min(self.room_m, float(self.at_m[self.p >= 1.0].min(initial=math.inf)))

    def nearer(self, margin_m: float) -> Clearance:
        """The same, all nearer by a margin."""
        return Clearance(np.maximum(self.at_m - margin_m, 0.0), self.p, self.room_m - margin_m)


def limit_speed(clearance: Clearance, begins_m: float, ends_m: float, actuator: ActuatorModel, borne: float) -> float:
    """The highest speed of a move from one place of the way to another that is not braked on it [m/s].

    Args:
        borne: speed at which a certain touch is borne [m/s].
    """
    counts = clearance.at_m >= begins_m
    at_m, harm = clearance.at_m[counts], borne**2 / clearance.p[counts]
    slowing = actuator.brake_m_per_s2 * LATENCY_S
    before = np.sqrt(slowing**2 + 2.0 * actuator.brake_m_per_s2 * (at_m - begins_m) + harm) - slowing
    fastest = np.where(at_m < ends_m, np.sqrt(harm), np.maximum(np.sqrt(harm), before))
    return float(fastest.min(initial=actuator.speed_m_per_s))


def choose_move(
    clearance: Clearance, wanted_m: float, actuator: ActuatorModel, borne: float, each_s: float
) -> tuple[float, float]:
    """How far, and how fast [m, m/s], the next move of those goes that together take the least time.

    Args:
        wanted_m: to be gone, where there is room for it.
        each_s: what each move takes besides.
    """
    most_m = min(wanted_m, clearance.room_m)
    ends = np.concatenate([clearance.at_m, clearance.at_m + END_M])
    ends = np.unique(np.round(ends[(ends >= MIN_MOVE_M) & (ends < most_m)], 3))
    places = [0.0, *ends.tolist(), most_m]
    left_s, chosen = [0.0] * len(places), (most_m, borne)
    for k in range(len(places) - 2, -1, -1):
        best_s = math.inf
        for j in range(k + 1, len(places)):
            speed = limit_speed(clearance, places[k], places[j], actuator, borne)
            takes_s = (places[j] - places[k]) / speed + each_s + left_s[j]
            if takes_s < best_s - 1e-9:
                best_s, chosen = takes_s, (places[j], speed)
        left_s[k] = best_s
    return chosen
