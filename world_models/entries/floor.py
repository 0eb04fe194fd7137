"""Free floor: how far the floor is seen or ranged to be free, and what ends it (§4: models are incomplete)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from blackboard import inference
from world_models import words

FloorSense = Literal["camera", "ranges"]
FloorEnd = Literal["thing", "model", "sight"]
LAST_FLOORS = 48
"""The newest that stay on the board."""
LAST_VIEWS = 12
"""The same of the pictures that later ones are compared with: the robot has driven over what the oldest show."""

Point = tuple[float, float]
Light = tuple[float, float, float]
"""By how much a picture's looks differ from the model's: logarithm of the brightness, parts of red and blue."""


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
        is_cut: whether the picture's lower border cuts its feet off: it may reach from there to the robot's rim.
        is_camouflaged: whether it looks like the floor: an earlier picture alone tells that it stands there.
    """

    footprint: tuple[Point, ...]
    sigma_m: float
    height_m: float
    sigma_height_m: float
    p_thing: float
    box_px: tuple[float, float, float, float]
    evidence: str
    is_cut: bool = False
    is_camouflaged: bool = False


@inference(keep=LAST_FLOORS)
@dataclass(frozen=True, slots=True)
class FreeFloor:
    """The floor that is free, by one picture or one reading of range sensors; it rests on that and on the belief.

    Attributes:
        sense: camera or ranges.
        locale: of the belief.
        x_m, y_m: of the sensor over the floor [m, world].
        bearings_rad: (n,) directions from there [rad, world], counter-clockwise.
        near_m: (n,) the floor is seen from here on; nearer, a thing too high to be rolled over may be hidden.
        far_m: (n,) up to here it is free; below ``near_m`` where none of it is.
        ends: (n,) what is there: a thing that the model lacks, something of the model, or the end of sight.
        sigma_m: (n,) standard deviations of ``far_m``.
        things: what ends it and is not in the model.
        seen_s: when, by the body's clock.
        light: of the picture; None where the floor's looks are not known in it.
        confirmed_m: (n,) up to here an earlier picture would show what is camouflaged; empty without.
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
    light: Light | None = None
    confirmed_m: tuple[float, ...] = ()

    @property
    def is_missing(self) -> bool:
        """Whether the model has floor in most of the directions that were looked in, and none of it is seen free."""
        is_free = any(far > near for near, far in zip(self.near_m, self.far_m, strict=True))
        return not is_free and 2 * sum(end != "model" for end in self.ends) > len(self.ends)

    def sentence(self) -> str:
        far = [far for near, far in zip(self.near_m, self.far_m, strict=True) if far > near]
        free = "nowhere seen to be free"
        if far:
            free = f"free for {words.metres(min(far))} where it is shortest, and {words.metres(max(far))} where longest"
        named = f"; {words.count(len(self.things), 'thing')} that the model lacks" if self.things else ""
        return f"the floor of {self.locale} is {free}, by the {self.sense}{named}; at {self.seen_s:.1f} s"


def picture_of(view: FloorView) -> Iterable[str]:
    return (view.frame,)


@inference(keep=LAST_VIEWS, needs=picture_of)
@dataclass(frozen=True, slots=True)
class FloorView:
    """A picture that later ones are compared with: what stands up from the floor moves differently than the floor.

    Attributes:
        frame: id of the frame entry; belief: that of the hypothesis by which the place is known.
        x_m, y_m, heading_rad: where the robot was [world]; sigma_m, sigma_rad: standard deviations of that.
        floor_m: height of the floor there [m, world].
        seen_s: when, by the body's clock.
        motion: id of the last report of the wheels until then, or "".
    """

    frame: str
    belief: str
    x_m: float
    y_m: float
    heading_rad: float
    floor_m: float
    seen_s: float
    sigma_m: float
    sigma_rad: float
    motion: str = ""

    def sentence(self) -> str:
        return f"{self.frame} is kept: the floor was seen from {words.point(self.x_m, self.y_m)} of the world"
