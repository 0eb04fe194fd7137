"""Wait: the robot stands for somebody who may come into its way; or it has waited long enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard import inference

WaitStatus = Literal["waiting", "over", "in vain"]


@inference(keep=8)
@dataclass(frozen=True, slots=True)
class PeopleWait:
    """A wait for people on a leg.

    Attributes:
        leg: id of the leg that waits.
        who: the name of the mover that is likeliest met; where: that one in words.
        p: how probably the next move would meet that one.
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
        return (f"{waits} for {self.who}: {self.where}; the next move would meet that one with {self.p:.1%};"
                f" for {self.at_s - self.since_s:.1f} s now")
