"""From the pictures of a door to what is believed of it: log odds of its not being open (§4: models are incomplete)."""

from __future__ import annotations

import math

from knowledge_sources.settings import DEFAULT
from knowledge_sources.settings.doors import DoorSettings
from world_models.entries.door_state import DoorCondition, DoorPicture, DoorState
from world_models.frames import wrap_angle


def update_door(
    known: DoorState | None, door: str, between: tuple[str, str], picture: DoorPicture, seen_s: float, *,
    is_believed_shut: bool, settings: DoorSettings = DEFAULT.doors,
) -> DoorState | None:
    """What is believed of a door after a picture; None where that picture adds nothing.

    A picture from where the last one was taken shows the same again: it counts only for what it says more.
    """
    log_odds = known.log_odds if known is not None else (1 if is_believed_shut else -1) * settings.prior_log_odds
    gain, count = picture.log_ratio, 0 if known is None else known.pictures
    if known is not None and is_same_view(known.last, picture, settings):
        gain = _stronger(picture.log_ratio, known.last.log_ratio)
        if gain == 0.0:
            return None
    else:
        count += 1
    if abs(gain) < settings.min_log_ratio:
        return None
    most = settings.max_log_odds
    log_odds = min(max(log_odds + gain, -most), most)
    state = _name_state(log_odds, count, known, settings)
    if known is not None and (state, log_odds) == (known.state, known.log_odds):
        return None
    p_shut = 1.0 / (1.0 + math.exp(-log_odds))
    certainty = 1.0 - p_shut if state == "open" else p_shut
    return DoorState(door, between, state, certainty, log_odds, count, picture, seen_s)


def is_same_view(one: DoorPicture, other: DoorPicture, settings: DoorSettings = DEFAULT.doors) -> bool:
    """Whether two pictures were taken from nearly the same pose."""
    near = math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) < settings.min_step_m
    return near and abs(wrap_angle(one.heading_rad - other.heading_rad)) < settings.min_turn_rad


def _stronger(now: float, before: float) -> float:
    """By how much a picture says more than another of the same view."""
    if now * before <= 0.0:
        return now
    return math.copysign(max(abs(now) - abs(before), 0.0), now)


def _name_state(log_odds: float, count: int, known: DoorState | None, settings: DoorSettings) -> DoorCondition:
    if log_odds >= settings.shut_log_odds and count >= settings.min_pictures:
        return "shut"
    if log_odds <= settings.open_log_odds:
        return "open"
    was = "unknown" if known is None else known.state
    return was if was == "shut" else "unknown"
