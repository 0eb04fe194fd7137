"""What passes between the mind and the body: motor commands and claims, requests to look and frames (§3.2)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MotorCommand:
    """The two primitive motions, one after the other: TURN on the spot, then MOVE straight ahead.

    Attributes:
        turn_rad: counter-clockwise [rad].
        move_m: forward, never negative [m].
    """

    turn_rad: float
    move_m: float

    def __post_init__(self) -> None:
        if not self.move_m >= 0.0:
            raise ValueError(f"expected a move forward (>= 0 m), got {self.move_m}")


@dataclass(frozen=True, slots=True)
class MotionReport:
    """What the wheel encoders claim was done, and how long it took."""

    turn_rad: float
    move_m: float
    duration_s: float
    sim_time_s: float


@dataclass(frozen=True, slots=True)
class Look:
    """A request for a picture.

    Attributes:
        purpose: ``track`` (follow landmarks), ``milestone`` (verify one) or ``probe`` (find out where we are).
    """

    purpose: str


@dataclass(frozen=True, slots=True)
class Frame:
    """A picture as the camera delivers it: compressed.

    Attributes:
        jpeg: the bytes; everything perceives what these decode to.
        number: counts the frames of a run from 0.
        sim_time_s: when it was taken.
        purpose: that of the :class:`Look` it answers.
    """

    jpeg: bytes
    number: int
    sim_time_s: float
    purpose: str = ""
