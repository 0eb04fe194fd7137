"""What passes between the agent and the body: motor commands and claims, requests to look and frames (§3.2)."""

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
class Course:
    """A motion that goes on until it is told otherwise; each revision is a correction in mid-move (§5).

    The body answers each with what the wheels claim since the one before, and with a picture that is taken on the move.
    Without another word it comes to a stand.

    Attributes:
        leg: id of the leg entry.
        speed_m_per_s: wanted, ahead; 0: come to a stand.
        curvature_per_m: of the arc to steer, positive to the left.
    """

    leg: str
    speed_m_per_s: float
    curvature_per_m: float

    def __post_init__(self) -> None:
        if not self.speed_m_per_s >= 0.0:
            raise ValueError(f"expected a speed ahead (>= 0 m/s), got {self.speed_m_per_s}")

    @property
    def is_rolling(self) -> bool:
        return self.speed_m_per_s > 0.0


@dataclass(frozen=True, slots=True)
class MotionReport:
    """What the wheel encoders claim was done, and how long it took."""

    turn_rad: float
    move_m: float
    duration_s: float
    sim_time_s: float


@dataclass(frozen=True, slots=True)
class Ride:
    """A request to be carried: somebody may press the button.

    Attributes:
        sketch: id of the sketch entry; index: which of its subgoals.
        passage: the link that is ridden; origin, destination: the locales that it joins.
    """

    sketch: str
    index: int
    passage: str
    origin: str
    destination: str


@dataclass(frozen=True, slots=True)
class RideReport:
    """What was told when the doors opened: where this is, and how long it took."""

    passage: str
    destination: str
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


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the wheels count that the robot is, from wherever the count began.

    Attributes:
        x_m, y_m, heading_rad: of the robot in the frame of the count, -pi <= heading <= pi.
        time_s: when it was so, by the clock of the base or, where it has none, of its driver.
    """

    x_m: float
    y_m: float
    heading_rad: float
    time_s: float


STOP_KEY = "stop key"
"""What a fault is called that is none: somebody wanted the robot to stand still."""


@dataclass(frozen=True, slots=True)
class BodyFault:
    """Something is wrong between the agent and the body: a request stays unanswered until it is over.

    Attributes:
        part: base, camera, elevator, or user for the stop key.
        what: link lost, base answers nonsense, stalled, camera unplugged, frame late, frame dropped, stop key ...
        detail: in words.
        request: id of the motor command or the look that was not answered.
        when_s: when it was noticed, by the body's clock.
        turn_rad, move_m: what the wheels claim to have done of a motor command by then; None where nothing is known.
        status: open, or over.
    """

    part: str
    what: str
    detail: str
    request: str
    when_s: float
    turn_rad: float | None = None
    move_m: float | None = None
    status: str = "open"

    @property
    def is_open(self) -> bool:
        return self.status == "open"


@dataclass(frozen=True, slots=True)
class Recovery:
    """The wish that a fault be over: wait, then try to have the request answered after all.

    Attributes:
        fault: id of the fault entry; request: id of the request that it kept from being answered.
        since_s: when the fault was noticed, by the body's clock.
        wait_s: how long to wait before the next try.
        tries: how many there were.
        waited_s: time from when the fault was noticed to the last try, by the body's clock.
        status: asked, in vain (try again, or give up) or over (the request is answered).
        what, detail: the fault as the last try found it, where it was in vain.
    """

    fault: str
    request: str
    since_s: float
    wait_s: float
    tries: int = 0
    waited_s: float = 0.0
    status: str = "asked"
    what: str = ""
    detail: str = ""
