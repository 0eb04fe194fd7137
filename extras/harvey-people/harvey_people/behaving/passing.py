"""Passing: how the next move leads by people: straight on, slower, or beside the leg's line, on the right rather."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from harvey_people.behaving.meeting import PERSON_M, THINKS_S, find_speed, measure_meeting, plan_beside, plan_straight
from harvey_people.seeing.mover import Mover
from knowledge_sources.methods.motion import MAX_HEADING_ERROR_RAD, find_aim, measure_progress
from world_models.actuator import ActuatorModel
from world_models.entries import Leg
from world_models.frames import Pose2, wrap_angle

LOOKAHEAD_M = 1.2
"""The motor steers at a point of the leg so far ahead."""
ASIDES_M = (0.0, -0.35, -0.7, 0.35, 0.7)
"""To the left of the leg's line; of two that are as good the one named first: people are passed on the right."""
MIN_TO_GO_M = 1.5
"""Nearer to a leg's end it goes to no side."""
TURN_S, TURN_RAD_PER_S = 0.4, math.radians(45.0)
"""What a turn on the spot takes, besides the turn."""
WINDOW_S = 4.0
"""Its side is the one on which it can use most of the next seconds, and is touched least."""
MET_P = 0.1
"""Where a touch in them is likelier another side may be better."""
GAIN = 1.1
"""From the side that it is on it goes to another one where that is better by this factor."""
UNMOVED_LOG_ODDS = -6.0
"""What is likelier to stand than this is a thing, and left to those who look after things."""
NEVER_MET_M = 8.0
"""Who is further away is not met by the next move."""


class PassingWay(NamedTuple):
    """How the next move leads.

    Attributes:
        leg: the leg, or one beside it.
        aside_m: how far that is to the left of it.
        speed_m_per_s: what is borne on it; 0: it waits.
        who: the mover that is likeliest touched straight on, at full speed; p: how probably.
    """

    leg: Leg
    aside_m: float
    speed_m_per_s: float
    who: Mover
    p: float


def shift(leg: Leg, aside_m: float) -> Leg:
    """A leg beside another one, so far to the left of it."""
    length = max(1e-9, math.hypot(leg.x1_m - leg.x0_m, leg.y1_m - leg.y0_m))
    dx, dy = (-aside_m * (leg.y1_m - leg.y0_m) / length, aside_m * (leg.x1_m - leg.x0_m) / length)
    return replace(leg, x0_m=leg.x0_m + dx, y0_m=leg.y0_m + dy, x1_m=leg.x1_m + dx, y1_m=leg.y1_m + dy)


def find_way(movers: Sequence[Mover], leg: Leg, here: Pose2, radius_m: float, actuator: ActuatorModel, now_s: float,
             borne: float, has_room: Callable[[tuple[float, float]], bool], kept_m: float = 0.0) -> PassingWay | None:
    """The way on which somebody who is ahead is touched least, of those on which the expected harm is borne.

    So it makes way to one who comes, in time. None where straight on at full speed is the best: nothing is to be
    decided then.

    Args:
        borne: speed at which a certain touch is borne [m/s].
        has_room: whether the robot has room to go straight to a point (x, y) [m, world], as far as walls are known.
        kept_m: the side that it is on.
    """
    near = [mover for mover in movers if mover.log_odds > UNMOVED_LOG_ODDS
            and math.dist((mover.x_m, mover.y_m), here.position) < NEVER_MET_M + PERSON_M]
    if not near:
        return None
    along_rad = math.atan2(leg.y1_m - leg.y0_m, leg.x1_m - leg.x0_m)
    along = np.array([math.cos(along_rad), math.sin(along_rad)])
    ahead = [mover for mover in near if (mover.state[:2] - here.position) @ along > 0.0]
    found: list[tuple[float, Leg, float, float]] = []
    p, who = 0.0, near[0]
    for aside_m in ASIDES_M if measure_progress(leg, here)[0] > MIN_TO_GO_M else (0.0,):
        beside = shift(leg, aside_m)
        aim = find_aim(beside, here, LOOKAHEAD_M)
        heading_rad = math.atan2(aim[1] - here.y_m, aim[0] - here.x_m)
        if aside_m and not has_room(aim):
            continue
        turn_rad = abs(wrap_angle(heading_rad - here.heading_rad))
        turns_s = TURN_S + turn_rad / TURN_RAD_PER_S if turn_rad > MAX_HEADING_ERROR_RAD else 0.0
        begins_s = now_s + THINKS_S + turns_s
        speed = find_speed(near, here, heading_rad, radius_m, actuator, begins_s, borne)
        beyond = plan_beside(here, aim, along_rad, WINDOW_S, radius_m, actuator.speed_m_per_s, now_s, begins_s)
        met, each = measure_meeting(ahead, beyond) if ahead else (None, ())
        if not aside_m:
            _, harms = measure_meeting(near, plan_straight(
                here, heading_rad, LOOKAHEAD_M, radius_m, actuator.speed_m_per_s, begins_s))
            p, who = max(zip((*harms, *each), (*near, *ahead), strict=True), key=lambda one: one[0])
            if speed >= actuator.speed_m_per_s and (met is None or met.p[-1] <= MET_P):
                return None
        free = 1.0 if met is None else 1.0 - float(met.p[-1])
        gain = max(0.0, WINDOW_S - turns_s) / WINDOW_S * free * (speed > 0.0)
        found.append((gain, beside, aside_m, speed))
    best = next((one for one in found if one[2] == kept_m), found[0])
    other = max(found, key=lambda one: one[0])
    _, beside, aside_m, speed = other if other[0] > GAIN * best[0] else best
    if not aside_m and speed >= actuator.speed_m_per_s:
        return None
    return PassingWay(beside, aside_m, speed, who, p)
