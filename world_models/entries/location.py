"""Locale-relative location (§3.1, §3.4): in which locale, where in its frame, and how sure.

How far off it may be at a stated risk is its protection level, in aviation's words. And where its headings should have
led it since a place that it knows: that shows the camera's yaw.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import NormalDist
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from blackboard import inference
from world_models import words
from world_models.frames import Pose, Pose2, flattened, wrap_angle

HypothesisStatus = Literal["held", "candidate"]


RISK = 1e-4
"""Probability that a pose is further off than its protection level."""
ALERT_LIMIT_M = 0.10
"""A place that may be further off is not available: where the belief is surer, another look is taken if it may be."""
SHARED_SIGMA_M = 0.0077
"""Deviation of what a model, a camera and a matcher share in all pictures of a mission, so that no covariance of one
picture has it: added in squares, it bounds how far beliefs are off in missions without a fault."""


@dataclass(frozen=True, slots=True, order=True)
class Protection:
    """A protection level.

    Attributes:
        place_m: the place is off by more with a probability of at most :data:`RISK`; heading_rad: the heading.
        doubted: what moves the place most where it is false.
    """

    place_m: float
    heading_rad: float
    doubted: str

    @property
    def is_available(self) -> bool:
        """Whether the place is known well enough for a certificate."""
        return self.place_m <= ALERT_LIMIT_M

    def words(self) -> str:
        return (f"protection level {words.metres(self.place_m)} and {words.degrees(self.heading_rad)}, by"
                f" {words.landmark(self.doubted)}")


UNPROTECTED = Protection(0.0, 0.0, "")
"""Nobody has asked how far off the pose may be."""


@lru_cache
def count_sigmas(alternatives: int) -> float:
    """Deviations beyond which a coordinate lies with a probability of :data:`RISK`, shared by so many alternatives."""
    return -NormalDist().inv_cdf(0.5 * RISK / alternatives)


class LocalePoses(Protocol):
    """What is needed of a world: the frames of its locales."""

    def world_from_locale(self, name: str, /) -> Pose: ...


Covariance = tuple[tuple[float, float, float], ...]
"""(3, 3) over (x_m, y_m, heading_rad)."""


def covariance_tuple(matrix: Any) -> Covariance:
    """A symmetric (3, 3) matrix as nested tuples, so that a value that holds it can be compared."""
    m = np.asarray(matrix, float)
    m = 0.5 * (m + m.T)
    a, b, c = ((float(r[0]), float(r[1]), float(r[2])) for r in m)
    return (a, b, c)


def diagonal(sigma_m: float, sigma_rad: float) -> Covariance:
    """Independent standard deviations of place and heading."""
    return covariance_tuple(np.diag([sigma_m**2, sigma_m**2, sigma_rad**2]))


@dataclass(frozen=True, slots=True)
class Place:
    """A point of the floor in a locale's own frame [m]; ``heading_rad`` there, None for any."""

    locale: str
    x_m: float
    y_m: float
    heading_rad: float | None = None

    def in_world(self, world: LocalePoses) -> Pose2:
        """The pose of a robot there, in the world frame; heading 0 of the locale where none is said."""
        return flattened(world.world_from_locale(self.locale)) @ Pose2(self.x_m, self.y_m, self.heading_rad or 0.0)

    @staticmethod
    def of_world(world: LocalePoses, locale: str, x_m: float, y_m: float, heading_rad: float | None = None) -> Place:
        """The place in a locale's frame of a point (and heading) of the world frame."""
        own = flattened(world.world_from_locale(locale)).inverse() @ Pose2(x_m, y_m, heading_rad or 0.0)
        return Place(locale, own.x_m, own.y_m, None if heading_rad is None else own.heading_rad)

    def words(self) -> str:
        """``allens-office (3.96, 3.66) m``."""
        return f"{self.locale or 'the world'} {words.point(self.x_m, self.y_m)}"

    def __str__(self) -> str:
        return f"({self.words()})"


@inference()
@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Where the robot believes it is.

    Attributes:
        locale: the deepest locale that contains it.
        locale_from_robot: its pose in that locale's frame.
        covariance: over (x, y, heading) in the locale's frame.
        basis: what it rests on last: command, odometry, tracks, milestone or relocalization.
        status: held (the one that is acted on) or candidate.
        weight: relative belief among candidates.
        motion: id of the last motion report that is taken into account, or "".
        evidence: what supports it, in words, where no other entry says it.
        correction: where it is, as seen from where it was believed to be, of one that a search has found.
        excess_m, excess_rad: by how much its protection level is above what its covariance says.
    """

    locale: str
    locale_from_robot: Pose2
    covariance: Covariance
    basis: str
    status: HypothesisStatus = "held"
    weight: float = 1.0
    motion: str = ""
    evidence: str = ""
    correction: Pose2 | None = None
    excess_m: float = 0.0
    excess_rad: float = 0.0

    @property
    def is_held(self) -> bool:
        return self.status == "held"

    @property
    def sigma_m(self) -> float:
        """Largest standard deviation of the position [m]."""
        return math.sqrt(max(0.0, float(np.linalg.eigvalsh(np.array(self.covariance)[:2, :2])[-1])))

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the heading [rad]."""
        return math.sqrt(max(0.0, self.covariance[2][2]))

    @property
    def protection_m(self) -> float:
        """The place is further off than this with a probability of at most :data:`.RISK` [m]."""
        return self.excess_m + count_sigmas(1) * math.hypot(self.sigma_m, SHARED_SIGMA_M)

    @property
    def protection_rad(self) -> float:
        """The same of the heading [rad]."""
        return self.excess_rad + count_sigmas(1) * self.sigma_rad

    def protected(self, protection: Protection) -> Hypothesis:
        """The same, with the protection level of what it rests on."""
        plain = replace(self, excess_m=0.0, excess_rad=0.0)
        return replace(plain, excess_m=max(0.0, protection.place_m - plain.protection_m),
                       excess_rad=max(0.0, protection.heading_rad - plain.protection_rad))

    def world_from_robot(self, world: LocalePoses) -> Pose2:
        return flattened(world.world_from_locale(self.locale)) @ self.locale_from_robot

    def covariance_world(self, world: LocalePoses) -> NDArray[np.float64]:
        """(3, 3) over (x, y, heading) in the world frame."""
        turn = _turn(flattened(world.world_from_locale(self.locale)).heading_rad)
        return np.asarray(turn @ np.array(self.covariance) @ turn.T)

    @staticmethod
    def of_world(
        world: LocalePoses, locale: str, world_from_robot: Pose2, covariance_world: Any, basis: str,
        *, status: HypothesisStatus = "held", weight: float = 1.0, motion: str = "", evidence: str = "",
    ) -> Hypothesis:
        """From a pose and covariance in the world frame."""
        locale_from_world = flattened(world.world_from_locale(locale)).inverse()
        turn = _turn(locale_from_world.heading_rad)
        own = turn @ np.asarray(covariance_world, float) @ turn.T
        pose = locale_from_world @ world_from_robot
        return Hypothesis(locale, pose, covariance_tuple(own), basis, status, weight, motion, evidence)

    def distance_from(self, other: Hypothesis) -> str:
        """How far it is from another hypothesis in the same locale, in words."""
        by = other.locale_from_robot.inverse() @ self.locale_from_robot
        return f"{words.metres(math.hypot(by.x_m, by.y_m))} and {words.degrees(abs(by.heading_rad))}"

    def place(self) -> str:
        """``hallway (12.21, 0.50) m``."""
        return Place(self.locale, self.locale_from_robot.x_m, self.locale_from_robot.y_m).words()

    def sentence(self) -> str:
        pose = self.locale_from_robot
        evidence = f"; {self.evidence}" if self.evidence else ""
        sure = words.sigma(self.covariance)
        likely = f" (weight {self.weight:.2f})" if self.status == "candidate" else ""
        return (f"{self.status}: in {self.locale} at {words.point(pose.x_m, pose.y_m)}, heading"
                f" {words.degrees(pose.heading_rad)}{likely}; {sure}, protection level"
                f" {words.metres(self.protection_m)}, by {self.basis}{evidence}")


@inference()
@dataclass(frozen=True, slots=True)
class PlaceOdds:
    """The prior: where the robot was told to be or had tracked to, as evidence among places that look alike.

    Attributes:
        locale: where it is believed to be.
        alias_count: number of the places between which the pictures did not tell, this one included.
        source: ``stated`` at the start, or ``tracked`` by milestones since.
        p_prior: probability that it is there, before any picture since it was lost.
        probability: with the pictures.
        refuted: how often a place that was believed by such odds was refuted before.
    """

    locale: str
    alias_count: int
    source: Literal["stated", "tracked"]
    p_prior: float
    probability: float
    refuted: int = 0

    def sentence(self) -> str:
        how = "this one was told at the start" if self.source == "stated" else "to this one it was tracked"
        return (f"{words.count(self.alias_count, 'place')} look alike from here; {how} ({self.p_prior:.0%} before any"
                f" picture): {self.locale}, {self.probability:.1%}")


@inference(keep=2)
@dataclass(frozen=True, slots=True)
class PlaceSearch:
    """What a lost robot's looks round tell of its place.

    Attributes:
        status: found; probe, where another look may tell more; or ambiguous, where none does.
        said: in words.
        probe: the turn [rad] and then the move [m] before the next look; None where no further one is worth it.
        is_camera_nominal: whether the pictures fit the camera as it was set up, and not as it was learnt.
    """

    status: Literal["found", "probe", "ambiguous"]
    said: str
    probe: tuple[float, float] | None = None
    is_camera_nominal: bool = False

    def sentence(self) -> str:
        return f"search of the floor: {self.said}"


@dataclass(frozen=True, slots=True)
class Alias:
    """A place that looks like where the robot believes that it is.

    Attributes:
        locale: the room where it was first.
        there_from_here: the pose there for a pose where it is believed to be, both in the world frame.
        log_ratio: log likelihood ratio of the pictures so far, of that place to the believed one.
    """

    locale: str
    there_from_here: Pose2
    log_ratio: float


@inference(keep=2)
@dataclass(frozen=True, slots=True)
class AliasOdds:
    """How likely the robot is where it believes, against the places that looked the same since it was sure of it.

    Attributes:
        p_prior: probability of the believed place before any picture.
        probability: with the pictures that are counted.
        aliases: the other places that are not refuted yet.
        counted: certificates of the pictures that are counted, each once.
        last: the pose, in the world frame, of the last of them.
    """

    p_prior: float
    probability: float
    aliases: tuple[Alias, ...]
    counted: tuple[str, ...]
    last: Pose2

    def sentence(self) -> str:
        if not self.aliases:
            return f"no other place looks like where it is, after {words.count(len(self.counted), 'picture')}"
        best = max(self.aliases, key=lambda alias: alias.log_ratio)
        return (f"{words.count(1 + len(self.aliases), 'place')} agree with {words.count(len(self.counted), 'picture')};"
                f" it is where it believes at {self.probability:.1%}, or else most likely as if it had begun in"
                f" {best.locale}")


def _turn(angle_rad: float) -> NDArray[np.float64]:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@inference()
@dataclass(frozen=True, slots=True)
class Travel:
    """The way since a place, as the believed headings and the wheels have it.

    Headings are the camera's direction less its believed yaw on the robot. Is that wrong, the robot drives aside of
    where it believes to head, and comes to the same distance in another direction.

    Attributes:
        began: pose at its begin, by a milestone or by tracks [world]; covariance: of it.
        x_m, y_m: where the wheels and the headings say that the robot is from there [world].
        gone_m: length of the way; pending_m: of its last motion, whose heading at the end was not seen yet.
        heading_rad: believed by the wheels after the last motion.
        slip_m2: variance of what the wheels slipped aside in turns.
        yaw_rad, yaw_variance: of the camera, as known when it began.
        is_broken: the robot was pushed, stopped or lost on it.
    """

    began: Pose2
    covariance: Covariance
    yaw_rad: float
    yaw_variance: float
    x_m: float = 0.0
    y_m: float = 0.0
    gone_m: float = 0.0
    pending_m: float = 0.0
    heading_rad: float = 0.0
    slip_m2: float = 0.0
    is_broken: bool = False

    def seen(self, heading_rad: float) -> Travel:
        """With the heading that was seen after the last motion: on an arc its way is half-way between both ends."""
        bent = 0.5 * wrap_angle(heading_rad - self.heading_rad) * self.pending_m
        return replace(self, x_m=self.x_m - bent * math.sin(heading_rad), y_m=self.y_m + bent * math.cos(heading_rad),
                       heading_rad=heading_rad, pending_m=0.0)

    def after_motion(self, before: Pose2, after: Pose2, slip_m: float) -> Travel:
        """After a motion that the wheels report, from a pose as it was seen to one as they say."""
        ahead = after.position - before.position
        seen, gone_m = self.seen(before.heading_rad), float(math.hypot(*ahead))
        return replace(seen, x_m=seen.x_m + float(ahead[0]), y_m=seen.y_m + float(ahead[1]),
                       gone_m=seen.gone_m + gone_m, pending_m=gone_m, heading_rad=after.heading_rad,
                       slip_m2=seen.slip_m2 + slip_m**2)

    def turned(self, turn_rad: float, forward_m: float) -> Travel:
        """The same way by headings that are all turned: the camera stays where it was, ``forward_m`` before the axis.
        """
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        return replace(self, began=turn_about_camera(self.began, turn_rad, forward_m), x_m=c * self.x_m - s * self.y_m,
                       y_m=s * self.x_m + c * self.y_m, heading_rad=self.heading_rad + turn_rad)

    @property
    def net_m(self) -> float:
        """Distance from its begin."""
        return math.hypot(self.x_m, self.y_m)

    def sentence(self) -> str:
        return (f"{words.metres(self.gone_m)} of way, {words.metres(self.net_m)} from where it began, by the wheels and"
                " the headings")


def begin_travel(pose: Pose2, covariance: object, yaw_rad: float, yaw_variance: float) -> Travel:
    """A way that begins at a pose (world) with its covariance (3, 3)."""
    return Travel(pose, covariance_tuple(covariance), yaw_rad, yaw_variance, heading_rad=pose.heading_rad)


def turn_about_camera(pose: Pose2, turn_rad: float, forward_m: float) -> Pose2:
    """A robot's pose turned about its camera, which is ``forward_m`` before its axis."""
    camera = pose @ Pose2(forward_m, 0.0, turn_rad)
    return camera @ Pose2(-forward_m, 0.0, 0.0)
