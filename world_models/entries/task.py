"""The task model (§3.3): commands, and what somebody says on the way; goals in conceptual-dependency form, plan
sketches, milestones and how it ended."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from blackboard import inference, observation
from world_models import words
from world_models.building.model_errors import LineErrors, unpack_errors
from world_models.entries.location import Covariance, Place

GoalStatus = Literal["active", "reached", "visited", "abandoned"]
SketchStatus = Literal["active", "done", "halted", "superseded"]
LegStatus = Literal["moving", "arrived", "halted"]
MilestoneVerdict = Literal["verified", "refuted", "not testable"]
MilestoneStatus = Literal["turning", "expected", "verified", "refuted", "not testable", "withdrawn"]


def is_inactive(task: Goal | PlanSketch) -> bool:
    return not task.is_active


def is_closed(milestone: Milestone) -> bool:
    return not milestone.is_open


def fix_judged(certificate: Certificate) -> tuple[str, ...]:
    return (certificate.fix,)


@observation()
@dataclass(frozen=True, slots=True)
class Command:
    """What the user asks for, and how the robot was put down.

    Attributes:
        text: ``(ptrans (locale (x,y,z)) (locale (x,y,z)))``, feet in each locale's own frame.
        start_heading_rad: heading in the first locale's frame.
        arrival_heading_rad: heading wanted at the end, in the last locale's frame; None for any.
        start_covariance: how well it was put down, in the first locale's frame.
        asks_to_restart: whether after a contact or an emergency stop somebody has to say go on.
    """

    text: str
    start_heading_rad: float
    arrival_heading_rad: float | None
    start_covariance: Covariance
    asks_to_restart: bool = False

    def sentence(self) -> str:
        arrival = "" if self.arrival_heading_rad is None else (
            f"; to arrive at heading {words.degrees(self.arrival_heading_rad)}")
        start = f"{words.degrees(self.start_heading_rad)} ({words.sigma(self.start_covariance)})"
        return f"the user asked for {self.text}; the robot was put down at heading {start}{arrival}"


@inference(keep=2, when=is_inactive)
@dataclass(frozen=True, slots=True)
class Goal:
    """A top-level goal: ptrans from one place to another.

    Attributes:
        status: active, reached, visited (reached, and more are to come) or abandoned (a new one replaces it, §2).
    """

    origin: Place
    destination: Place
    status: GoalStatus = "active"

    @property
    def is_active(self) -> bool:
        return self.status == "active"

    def sentence(self) -> str:
        return f"goal: from {self.origin.words()} to {self.destination.words()}; {self.status}"


@dataclass(frozen=True, slots=True)
class Subgoal:
    """(ptrans a b) within a plan sketch.

    Attributes:
        primitive: an unobstructed straight line, executed without further reasoning (§5).
        passage: the doorway that it goes through, or "".
        tolerance_m: how near to ``destination`` is near enough.
    """

    origin: Place
    destination: Place
    primitive: bool
    passage: str = ""
    tolerance_m: float = 0.1

    @property
    def is_ride(self) -> bool:
        """Whether it is carried out by an elevator: it has a passage, and there is nothing to drive or to refine."""
        return bool(self.passage) and not self.primitive

    def __str__(self) -> str:
        return f"(ptrans {self.origin} {self.destination})"


@inference(keep=2, when=is_inactive)
@dataclass(frozen=True, slots=True)
class PlanSketch:
    """(M0 (ptrans a b) M1 (ptrans b c) ... Mg), approximate, abstract and tentative (§3.3).

    Attributes:
        goal: id of the goal entry that it serves.
        path: where it hangs in the tree of Figure 3: () for the first level, (1,) refines its subgoal 1.
        locale: the locale that it crosses, or "" for the first level, which goes from locale to locale.
        subgoals: n of them; milestone k precedes subgoal k, milestone n at the end.
        at: the subgoal that is next or under way; n at the end.
        verified: whether milestone ``at`` holds.
        status: active, done, halted before floor that is not seen, or superseded.
        is_look: whether it leads to where something that left no way can be looked at again, and not to the goal.
        halts: so often in a row a leg was halted and the sketch drawn again for it.
        adjustments: how often plan-level servoing changed it.
    """

    goal: str
    path: tuple[int, ...]
    locale: str
    subgoals: tuple[Subgoal, ...]
    at: int = 0
    verified: bool = False
    status: SketchStatus = "active"
    halts: int = 0
    adjustments: int = 0
    is_look: bool = False

    @property
    def is_active(self) -> bool:
        return self.status == "active"

    @property
    def at_end(self) -> bool:
        return self.at == len(self.subgoals)

    @property
    def current(self) -> Subgoal | None:
        """The subgoal that is next or under way; None at the end."""
        return None if self.at_end else self.subgoals[self.at]

    @property
    def is_refinable(self) -> bool:
        """Whether what is next is to be drawn in more detail before it is driven."""
        return self.current is not None and not self.current.primitive and not self.current.is_ride

    @property
    def leaves_goal_open(self) -> bool:
        """Whether it has ended, and its goal needs another one."""
        return self.status in ("superseded", "halted") or (self.is_look and self.status == "done")

    def carries_out(self, _id: str, sketch: PlanSketch) -> bool:
        """Whether it refines the current subgoal of another sketch."""
        return self.goal == sketch.goal and self.path == (*sketch.path, sketch.at)

    def advanced(self) -> PlanSketch:
        """The current subgoal is done; its milestone is yet to be verified."""
        return replace(self, at=self.at + 1, verified=False)

    def where(self) -> str:
        """Through which locale it leads, in words."""
        return f"through {self.locale}" if self.locale else "from locale to locale"

    def sentence(self) -> str:
        if self.status != "active":
            ended = "withdrawn" if self.status == "superseded" else self.status
            progress = f"{ended} in part {min(self.at + 1, len(self.subgoals))} of {len(self.subgoals)}"
        else:
            state = "is verified" if self.verified else "is still to be verified"
            progress = f"M{self.at} of its milestones M0 to M{len(self.subgoals)} {state}"
        steps = " then ".join(step.destination.words() + (f" by {step.passage}" if step.passage else "")
                              for step in self.subgoals)
        adjusted = f", adjusted {words.count(self.adjustments, 'time')}" if self.adjustments else ""
        return f"plan sketch {self.where()}: {progress}; to {steps}{adjusted}"


@inference(keep=2)
@dataclass(frozen=True, slots=True)
class Leg:
    """A primitive subgoal under execution: a straight line in the world frame.

    Attributes:
        sketch: id of the sketch entry; index: which of its subgoals.
        x0_m, y0_m, x1_m, y1_m: from where to where [m, world].
        tolerance_m: how near is near enough.
        heading_rad: the heading wanted at the end [rad, world]; None for any.
        increments: motor commands so far.
        status: moving, arrived or halted.
        to_go_m, left_m: what was left along the line, and how far to the left of it the robot was believed to be, when
            the last increment was decided; None before the first.
        aim_rad: how far to the left of its heading the point lay that it then steered at [rad].
        looking_rad: the heading that the robot turns to, to see floor that it will need [rad, world]; None on the way.
        looked_at: x, y and heading of each such look on this leg.
        turned_rad: how far it has turned towards its aim since it last moved [rad].
    """

    sketch: str
    index: int
    x0_m: float
    y0_m: float
    x1_m: float
    y1_m: float
    tolerance_m: float
    heading_rad: float | None = None
    increments: int = 0
    status: LegStatus = "moving"
    to_go_m: float | None = None
    left_m: float | None = None
    aim_rad: float | None = None
    looking_rad: float | None = None
    looked_at: tuple[tuple[float, float, float], ...] = ()
    turned_rad: float = 0.0

    def carries_out(self, id: str, sketch: PlanSketch) -> bool:
        """Whether it is the way of the current subgoal of a sketch, which is called so on the board."""
        return self.sketch == id and self.index == sketch.at

    def sentence(self) -> str:
        length_m = math.hypot(self.x1_m - self.x0_m, self.y1_m - self.y0_m)
        return (f"straight leg of {words.metres(length_m)}, {self.status} after"
                f" {words.count(self.increments, 'increment')}; from {words.point(self.x0_m, self.y0_m)} to"
                f" {words.point(self.x1_m, self.y1_m)} in the world (subgoal {self.index} of {self.sketch}, near enough"
                f" within {words.metres(self.tolerance_m)}){self._tell_look()}")

    def _tell_look(self) -> str:
        if self.looking_rad is None:
            return ""
        return f"; looks at the floor ahead first, at heading {words.degrees(self.looking_rad)}"


@inference(keep=2, when=is_closed)
@dataclass(frozen=True, slots=True)
class Milestone:
    """A perceptual event that should be seen at a place (§3.3, §4), and what has become of it.

    Attributes:
        sketch: id of the sketch entry, or "" for a check in between.
        index: milestone number in the sketch.
        what: in words.
        look_heading_rad: in which direction its landmarks are seen [rad, world].
        landmarks: names of the landmarks that are expected.
        expected: the visible model lines, ((x0, y0, z0), (x1, y1, z1)) [m, world].
        expected_px: their expected projection, ((u0, v0), (u1, v1)).
        landmark_of: for each line, its index in ``landmarks``.
        face_colors: of each face that should be seen its colour (red, green, blue; 0..1) and points [m, world].
        tried: headings of earlier views in which it was not testable [rad, world].
        displacement_modes: what of the model may be displaced as one: walls, doors, things.
        displacements: by how much a standard deviation of a mode displaces a line: (mode, line, x, y, z [m, world]).
        log_odds_so_far: of a wrong place, by each of these looks; 0 where one said nothing.
        status: turning (not yet looking there), expected, verified, refuted, not testable, or withdrawn (what is
            known of the building has changed, and it rested on that).
    """

    sketch: str
    index: int
    what: str
    look_heading_rad: float
    landmarks: tuple[str, ...] = ()
    expected: tuple[tuple[tuple[float, ...], ...], ...] = ()
    expected_px: tuple[tuple[tuple[float, ...], ...], ...] = ()
    landmark_of: tuple[int, ...] = ()
    face_colors: tuple[tuple[tuple[float, ...], tuple[tuple[float, ...], ...]], ...] = ()
    tried: tuple[float, ...] = ()
    displacement_modes: tuple[str, ...] = ()
    displacements: tuple[tuple[float, ...], ...] = ()
    log_odds_so_far: tuple[float, ...] = ()
    status: MilestoneStatus = "turning"

    @property
    def is_open(self) -> bool:
        return self.status in ("turning", "expected")

    @property
    def errors(self) -> LineErrors:
        """How well the model knows its lines."""
        return unpack_errors(self.displacement_modes, self.displacements, len(self.expected))

    @property
    def is_inexact(self) -> bool:
        """Whether its lines may be displaced by more than what is measured."""
        return not self.errors.is_exact

    def name(self) -> str:
        """``M1 of the route``, or ``the place where it believes to be``; without the reason for a check."""
        return self.what.partition(", because")[0]

    def sentence(self) -> str:
        names = [words.landmark(name) for name in self.landmarks]
        lines = words.count(len(self.expected), "model line")
        seen = f"; should show {lines} of {words.listed(names, 4)}" if names else ""
        of = f"of {self.sketch}" if self.sketch else "in between"
        return (f"milestone {self.what} is {self.status}; {of}, looking along"
                f" {words.degrees(self.look_heading_rad)}{seen}")


@inference(keep=2, needs=fix_judged)
@dataclass(frozen=True, slots=True)
class Certificate:
    """The verdict on a milestone, with its evidence.

    Attributes:
        milestone: id of the milestone entry.
        fix: id of the pose fix that it rests on, or "".
        verdict: verified, refuted or not testable.
        reason: in words.
        expected, matched: numbers of model lines that should be in view at the pose, and of those that are found there.
        inliers: of the pairs of line and segment by which the pose was solved for.
        coverage: part of the expected line length that was found, 0..1.
        residual_px: RMS distance of the inliers.
        deviation_m, deviation_rad, deviation_px: from the belief that predicted it.
        tolerance_px: up to where the wheels may have put it (§3.2) and the plan may adjust it (§6.1.4's window).
        p_false: probability that the pose is wrong by this picture alone, as counted on rendered floors where half of
            the places are, or that of a place that looks the same if it is larger.
        p_wrong: the probability of a wrong place by which the verdict was decided, with what was believed before.
        most_p_wrong: the bound on it that decided: up to it a place is verified; of what agrees too little for any
            place, from it on it is refuted.
        faces, faces_agreeing: how many faces' colours were compared, and the part of them that is as the model says.
    """

    milestone: str
    fix: str
    verdict: MilestoneVerdict
    reason: str
    expected: int
    matched: int
    inliers: int
    coverage: float
    residual_px: float
    deviation_m: float
    deviation_rad: float
    deviation_px: float
    tolerance_px: float
    p_false: float
    p_wrong: float
    most_p_wrong: float
    faces: int = 0
    faces_agreeing: float = 0.0

    def sentence(self) -> str:
        shift = (f"{words.quantity(self.deviation_px, 'px')} of the {words.quantity(self.tolerance_px, 'px')} that may"
                 " be corrected")
        return (f"{self.verdict}: {self.reason}; {self.milestone}; {words.metres(self.deviation_m)} and"
                f" {words.degrees(self.deviation_rad)} from the belief, {shift}")


@inference()
@dataclass(frozen=True, slots=True)
class Impasse:
    """A knowledge source sees no way on: the mission ends by it, unless another one does.

    Attributes:
        kind: how the mission would end: blocked, lost, failed or stopped.
        reason: in words.
        goal: id of the goal to which no way leads; "" where it is no matter of a way.
        behind: ids of the obstacles that leave none, or of the door that may be shut.
        is_open: whether nobody has seen a way on.
        lookout: where the robot goes to look again at what leaves no way [m, world]; (): nowhere.
    """

    kind: str
    reason: str
    goal: str = ""
    behind: tuple[str, ...] = ()
    is_open: bool = True
    lookout: tuple[float, ...] = ()

    def sentence(self) -> str:
        return f"no way on: {self.reason}" if self.is_open else f"something else is tried, as {self.reason}"


@inference()
@dataclass(frozen=True, slots=True)
class Outcome:
    """How the mission ended: reached, lost, blocked, failed or stopped (somebody wanted it to), and why."""

    kind: str
    reason: str

    def sentence(self) -> str:
        return f"the mission ended: {self.kind}, because {self.reason}"


@observation()
@dataclass(frozen=True, slots=True)
class Resumed:
    """A run that was cut off goes on; the robot was stopped in between.

    Attributes:
        after_cycle: the last cycle that was written down.
        interrupted: motor commands (refs as ``MotorCommand-3.0``) that were written down, but of which nobody heard how
            far they were carried out; they are not carried out again, the wheels are asked instead.
    """

    after_cycle: int
    interrupted: tuple[str, ...] = ()

    def sentence(self) -> str:
        heard = "".join(f"; how far {ref} was carried out is not known" for ref in self.interrupted)
        where = f"the run was cut off after cycle {self.after_cycle} and goes on"
        return f"{where}; the robot was stopped in between{heard}"


ReportedState = Literal["shut", "open", "gone", "there"]
DOOR_STATES: tuple[ReportedState, ...] = ("shut", "open")
BELIEVED, KNOWN = "and believes it from now on", "which it knew already"
OTHERWISE = "but has found otherwise since"
"""What became of a report."""


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
