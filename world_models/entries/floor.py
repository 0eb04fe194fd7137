"""Free floor: how far the floor is seen or ranged to be free, and what ends it (§4: models are incomplete)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard.kinds import inference
from world_models import words

FloorSense = Literal["camera", "ranges"]
FloorEnd = Literal["thing", "model", "sight"]
LAST_FLOORS = 48
"""The newest that stay on the board."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FloorThing:
    """Something on the floor in one picture, or in one reading of range sensors, that the model does not explain.

    Attributes:
        footprint: (k, 2) corners, counter-clockwise, of what it takes of the floor, as far as it is seen [m, world].
        sigma_m: standard deviation of its near side.
        height_m: of its top above the floor; sigma_height_m: standard deviation; infinite where nothing tells it.
        p_thing: probability that it is solid and higher than what the robot rolls over.
        box_px: (left, top, right, bottom) of it in the rectified picture; of ranges (0, 0, 0, 0).
        evidence: what tells that it is there, in words.
    """

    footprint: tuple[Point, ...]
    sigma_m: float
    height_m: float
    sigma_height_m: float
    p_thing: float
    box_px: tuple[float, float, float, float]
    evidence: str


@inference(keep=LAST_FLOORS)
@dataclass(frozen=True, slots=True)
class FreeFloor:
    """The floor that is free, by one picture or one reading of range sensors; it rests on that and on the belief.

    Attributes:
        sense: camera or ranges.
        locale: of the belief.
        x_m, y_m: of the sensor over the floor [m, world].
        bearings_rad: (n,) directions from there [rad, world], counter-clockwise.
        near_m: (n,) the floor is seen from here on; nearer, a thing higher than what the robot rolls over may be hidden.
        far_m: (n,) up to here it is free; below ``near_m`` where none of it is.
        ends: (n,) what is there: a thing that the model lacks, something of the model, or the end of sight.
        sigma_m: (n,) standard deviations of ``far_m``.
        things: what ends it and is not in the model.
        seen_s: when, by the body's clock.
    """

    sense: FloorSense
    locale: str
    x_m: float
    y_m: float
    bearings_rad: tuple[float, ...]
    near_m: tuple[float, ...]
    far_m: tuple[float, ...]
    ends: tuple[FloorEnd, ...]
    sigma_m: tuple[float, ...]
    things: tuple[FloorThing, ...]
    seen_s: float

    def sentence(self) -> str:
        far = [far for near, far in zip(self.near_m, self.far_m, strict=True) if far > near]
        free = f"free up to {words.metres(min(far))} to {words.metres(max(far))}" if far else "nowhere seen to be free"
        named = f"; {words.count(len(self.things), 'thing')} that the model lacks" if self.things else ""
        return f"the floor of {self.locale} is {free}, by the {self.sense}{named}; at {self.seen_s:.1f} s"
