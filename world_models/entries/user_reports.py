"""What somebody tells the robot on its way: a door is shut, a thing is gone, go elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard import observation

ReportedState = Literal["shut", "open", "gone", "there"]
DOOR_STATES: tuple[ReportedState, ...] = ("shut", "open")


@observation()
@dataclass(frozen=True, slots=True)
class UserReport:
    """Somebody says how a door or a thing of the building is.

    Attributes:
        what: name of the door or thing, as ``library-door`` or ``allens-office/desk``.
        state: shut or open (a door), gone or there (a thing).
        answer: what became of it, in words; "" until it was taken up.
    """

    what: str
    state: ReportedState
    answer: str = ""

    def sentence(self) -> str:
        return f"was told that {self.what} is {self.state}" + f"; {self.answer}" * bool(self.answer)


GO_ON = "go on"
"""What somebody says who asks for no other goal, but lets the robot start again after a stop."""


@observation()
@dataclass(frozen=True, slots=True)
class Redirection:
    """Somebody asks the robot, on its way, to go elsewhere, or after a stop to go on.

    Attributes:
        text: where to: "Go to the library", "library", ``(library (6,10,0))``, feet in the locale's frame; or "go on".
        by: who asks: "user" where the mission's file says so, "live page" while the run goes on.
        answer: what became of it, in words; "" until it was taken up.
    """

    text: str
    by: str = "user"
    answer: str = ""

    @property
    def asked(self) -> str:
        return f"to {GO_ON}" if self.text == GO_ON else f"to go elsewhere: {self.text}"

    def sentence(self) -> str:
        return f"was asked {self.asked}" + f"; {self.answer}" * bool(self.answer)
