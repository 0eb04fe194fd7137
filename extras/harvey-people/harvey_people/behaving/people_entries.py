"""What it does for the sake of people: it stands for somebody who may come into its way, or passes somebody."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard import inference
from world_models import words

WaitStatus = Literal["waiting", "over", "in vain"]


@inference(keep=8)
@dataclass(frozen=True, slots=True)
class PeopleWait:
    """A wait for people on a leg.

    Attributes:
        leg: id of the leg that waits.
        who: the name of the mover that is likeliest met; where: that one in words.
        p: how probably the robot would touch that one straight on.
        since_s, at_s: when it began, and when it was looked last, by the body's clock.
        looks: pictures that were taken meanwhile.
        status: waiting, over (it goes on), or in vain: the way stayed blocked too long.
    """

    leg: str
    who: str
    where: str
    p: float
    since_s: float
    at_s: float
    looks: int = 0
    status: WaitStatus = "waiting"

    def sentence(self) -> str:
        if self.status == "over":
            return f"goes on after {self.at_s - self.since_s:.1f} s: {self.who} is not met by the next move"
        waits = "waits" if self.status == "waiting" else "waited in vain"
        return (f"{waits} for {self.who}: {self.where}; risk of a touch {self.p:.1%};"
                f" for {self.at_s - self.since_s:.1f} s now")


@inference(keep=8)
@dataclass(frozen=True, slots=True)
class PeoplePass:
    """A move that leads by somebody slower, or beside the line of its leg.

    Attributes:
        leg: id of the leg.
        who, where, p: as of a wait: of the move straight on at full speed.
        aside_m: how far to the left of the leg's line it goes.
        speed_m_per_s: at most so fast.
    """

    leg: str
    who: str
    where: str
    p: float
    aside_m: float
    speed_m_per_s: float

    def sentence(self) -> str:
        side = "right" if self.aside_m < 0.0 else "left"
        how = f"{words.metres(abs(self.aside_m))} to the {side} of its line" if self.aside_m else "on its line"
        return (f"passes {self.who}, {how}, at most {self.speed_m_per_s:.2f} m/s: {self.where}; risk of a touch"
                f" straight on {self.p:.1%}")


@inference(keep=8)
@dataclass(frozen=True, slots=True)
class PeopleHide:
    """What people hide of a milestone in a picture.

    Attributes:
        milestone: id of its entry.
        hidden, of: of so many expected lines so many are hidden.
        who: names of the movers that stand before them.
        at_s: when, by the body's clock.
    """

    milestone: str
    hidden: int
    of: int
    who: tuple[str, ...]
    at_s: float

    def sentence(self) -> str:
        return (f"{self.hidden} of {words.count(self.of, 'line')} of {self.milestone} are hidden by"
                f" {', '.join(self.who)} at {self.at_s:.1f} s, and are not asked of the picture")
