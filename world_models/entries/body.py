"""What passes between the agent and the body: motor commands and claims, requests to look and frames (§3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from blackboard import Entry, View, observation, request
from world_models import words

FaultStatus = Literal["open", "over"]
RecoveryStatus = Literal["asked", "still failing", "over"]

LAST_REQUESTS = 8
"""The newest requests and faults that stay on the board: the fault handler looks back over a few of them."""

CREEP_M_PER_S = 0.1
"""A move that is slower creeps."""
LAST_REPORTS = 32
"""The newest reports of the wheels that stay: they tell the motion between two pictures that are compared."""


def is_closed(fault: BodyFault) -> bool:
    return not fault.is_open


def has_its_request(view: View, fault: Entry[BodyFault]) -> bool:
    """Whether the request that a fault interrupted is still on the board."""
    return view.get(fault.value.request) is not None


def request_of_open_fault(fault: BodyFault) -> tuple[str, ...]:
    return (fault.request,) if fault.is_open else ()


def is_recovered(recovery: Recovery) -> bool:
    return recovery.status == "over"


@request(keep=LAST_REQUESTS)
@dataclass(frozen=True, slots=True)
class MotorCommand:
    """The two primitive motions, one after the other: TURN on the spot, then MOVE straight ahead.

    Attributes:
        turn_rad: counter-clockwise [rad].
        move_m: forward, never negative [m].
        speed_m_per_s: at most so fast in the move; None for the speed of the base.
    """

    turn_rad: float
    move_m: float
    speed_m_per_s: float | None = None

    def __post_init__(self) -> None:
        if not self.move_m >= 0.0:
            raise ValueError(f"expected a move forward (>= 0 m), got {self.move_m}")
        if self.speed_m_per_s is not None and not self.speed_m_per_s > 0.0:
            raise ValueError(f"expected a speed above 0 m/s, got {self.speed_m_per_s}")

    @property
    def is_creeping(self) -> bool:
        """Whether it goes so slowly that a touch does no harm."""
        return self.move_m > 0.0 and self.speed_m_per_s is not None and self.speed_m_per_s < CREEP_M_PER_S

    def sentence(self) -> str:
        slowly = ", slowly" * self.is_creeping
        most = "" if self.speed_m_per_s is None else f", at {self.speed_m_per_s:.2f} m/s"
        return words.motion(self.turn_rad, self.move_m) + slowly + most


@request(keep=LAST_REQUESTS)
@dataclass(frozen=True, slots=True)
class Course:
    """A motion that goes on until it is revised; each revision is a correction in mid-move (§5).

    The body answers each with what the wheels claim since the one before, and with a picture that is taken on the move.
    Without a revision it ends by a stop.

    Attributes:
        leg: id of the leg entry.
        speed_m_per_s: wanted, ahead; 0: stop.
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

    def sentence(self) -> str:
        if not self.is_rolling:
            return "come to a stand"
        return f"roll on at {self.speed_m_per_s:.2f} m/s, bending by {words.bend(self.curvature_per_m)}"


@observation(keep=LAST_REPORTS)
@dataclass(frozen=True, slots=True)
class MotionReport:
    """What the wheel encoders claim was done, and how long it took."""

    turn_rad: float
    move_m: float
    duration_s: float
    sim_time_s: float

    def sentence(self) -> str:
        done = words.motion(self.turn_rad, self.move_m)
        return f"the wheels claim: {done}; in {self.duration_s:.1f} s, at {self.sim_time_s:.1f} s"


@request(keep=LAST_REQUESTS)
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

    def sentence(self) -> str:
        return f"asks for a ride in {self.passage} from {self.origin} to {self.destination}"


@observation(keep=2)
@dataclass(frozen=True, slots=True)
class RideReport:
    """What was reported when the doors opened: where this is, and how long it took."""

    passage: str
    destination: str
    duration_s: float
    sim_time_s: float

    def sentence(self) -> str:
        return f"the elevator doors opened at {self.destination}; after {self.duration_s:.0f} s"


@request(keep=LAST_REQUESTS)
@dataclass(frozen=True, slots=True)
class PictureRequest:
    """A request for a picture.

    Attributes:
        purpose: ``track`` (follow landmarks), ``milestone`` (verify one) or ``probe`` (find out where we are).
    """

    purpose: str

    def sentence(self) -> str:
        return f"asks for a picture {words.purpose(self.purpose)}"


@observation(keep=2)
@dataclass(frozen=True, slots=True)
class CameraPicture:
    """A picture as the camera delivers it: compressed.

    Attributes:
        jpeg: the bytes; everything perceives what these decode to.
        number: counts the frames of a run from 0.
        sim_time_s: when it was taken.
        purpose: that of the :class:`PictureRequest` it answers.
    """

    jpeg: bytes
    number: int
    sim_time_s: float
    purpose: str = ""

    def sentence(self) -> str:
        return f"picture of {self.sim_time_s:.1f} s into the run; {words.purpose(self.purpose)}"


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


@observation(keep=LAST_REQUESTS, when=is_closed, unless=has_its_request, needs=request_of_open_fault)
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
    status: FaultStatus = "open"

    @property
    def is_open(self) -> bool:
        return self.status == "open"

    def sentence(self) -> str:
        state = "is at fault" if self.is_open else "was at fault"
        claims = words.motion(self.turn_rad or 0.0, self.move_m or 0.0)
        done = f"; of {self.request} the wheels claim: {claims}" if self.turn_rad or self.move_m else ""
        since = f"since {self.when_s:.1f} s into the run"
        return f"the {self.part} {state} {since}: {self.what} ({self.detail}){done}; {self.status}"


@request(keep=LAST_REQUESTS, when=is_recovered)
@dataclass(frozen=True, slots=True)
class Recovery:
    """The wish that a fault be over: wait, then try to have the request answered after all.

    Attributes:
        fault: id of the fault, or of a stop; request: id of the request that was not answered, "" after a stop.
        since_s: when the fault was noticed, by the body's clock.
        wait_s: how long to wait before the next try.
        tries: how many there were.
        waited_s: time from when the fault was noticed to the last try, by the body's clock.
        status: asked, still failing (try again, or give up) or over (the request is answered).
        what, detail: the fault as the last try found it, where it failed.
    """

    fault: str
    request: str
    since_s: float
    wait_s: float
    tries: int = 0
    waited_s: float = 0.0
    status: RecoveryStatus = "asked"
    what: str = ""
    detail: str = ""

    def sentence(self) -> str:
        if not self.request:
            return f"waits for somebody to say go on after {self.fault}, {self.waited_s:.1f} s so far"
        if self.status == "asked":
            tries = words.count(self.tries, "try", "tries")
            return f"waits {self.wait_s:.2f} s and tries again; to have {self.request} answered, {tries} so far"
        ended = "it worked" if self.status == "over" else f"still failing: {self.what} ({self.detail})"
        return f"tried again: {ended}; to have {self.request} answered after {self.fault}, {self.waited_s:.1f} s in all"
