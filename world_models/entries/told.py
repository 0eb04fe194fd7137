"""What somebody tells the robot of the building: a door is shut, a thing is gone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard.kinds import observation

ToldState = Literal["shut", "open", "gone", "there"]
DOOR_STATES: tuple[ToldState, ...] = ("shut", "open")


@observation()
@dataclass(frozen=True, slots=True)
class Told:
    """Somebody says how a door or a thing of the building is.

    Attributes:
        what: name of the door or thing, as ``library-door`` or ``allens-office/desk``.
        state: shut or open (a door), gone or there (a thing).
        answer: what became of it, in words; "" until it was taken up.
    """

    what: str
    state: ToldState
    answer: str = ""

    def sentence(self) -> str:
        return f"was told that {self.what} is {self.state}" + f"; {self.answer}" * bool(self.answer)
