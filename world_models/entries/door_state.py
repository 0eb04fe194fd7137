"""Doors: whether one is open or shut, by what pictures show in its opening."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard import inference

DoorCondition = Literal["open", "shut", "unknown"]


@dataclass(frozen=True, slots=True)
class DoorPicture:
    """What one picture says of a door.

    Attributes:
        frame: id of the picture.
        box_px: the opening in it: left, top, right, bottom of the rectified picture.
        x_m, y_m, heading_rad: where the robot believed to be [world].
        log_ratio: log likelihood ratio of a leaf against an open doorway.
        shows: what is seen in the opening, in words.
    """

    frame: str
    box_px: tuple[float, float, float, float]
    x_m: float
    y_m: float
    heading_rad: float
    log_ratio: float
    shows: str


@inference()
@dataclass(frozen=True, slots=True)
class DoorState:
    """Whether a door is open or shut.

    Attributes:
        door: its name; between: the locales that it joins.
        state: open, shut, or unknown as long as that is not certain.
        certainty: probability of the state, 0..1; of unknown: that the door is not open.
        log_odds: of not being open, all pictures together.
        pictures: number of them that were counted.
        last: the last of them.
        seen_s: when that was taken, by the body's clock.
        prior: log odds before any picture.
        views: the pictures that are counted, the last one last; empty where the last one alone is.
        touched_s: when something was touched in its opening, by the body's clock; None where nothing was.
    """

    door: str
    between: tuple[str, str]
    state: DoorCondition
    certainty: float
    log_odds: float
    pictures: int
    last: DoorPicture
    seen_s: float
    prior: float = 0.0
    views: tuple[DoorPicture, ...] = ()
    touched_s: float | None = None

    @property
    def is_passable(self) -> bool:
        return self.state != "shut"

    @property
    def may_be_shut(self) -> bool:
        """Whether that is likelier than not, and not certain."""
        return self.state == "unknown" and self.log_odds > 0.0

    def sentence(self) -> str:
        said = f"{self.door} is {self.state}"
        if self.state == "unknown":
            said = f"{self.door} may be shut" if self.log_odds > 0.0 else f"{self.door} is not known to be open or shut"
        seen = f"{self.pictures} picture{'s' * (self.pictures != 1)}"
        touched = "" if self.touched_s is None else f"; something was touched in it at {self.touched_s:.1f} s"
        return f"{said}, with a probability of {self.certainty:.1%} by {seen}: the last showed {self.last.shows} in " \
               f"its opening, at {self.seen_s:.1f} s{touched}"
