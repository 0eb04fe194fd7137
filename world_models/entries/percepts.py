"""What perception puts on the board: tracks, segments, matches and pose fixes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blackboard import Entry, Level, View, inference
from world_models import words
from world_models.entries.discrepancy import OPEN
from world_models.entries.location import UNPROTECTED, Covariance, Protection
from world_models.frames import Pose2

LAST_SEGMENTS = 8
"""The newest segments that stay on the board: the obstruction finder compares several looks."""


def template_frames(tracks: Tracks) -> tuple[str, ...]:
    return tuple(track.template_frame for track in tracks.items)


def may_be_of_a_probe(view: View, segments: Entry[Segments]) -> bool:
    """Whether segments may be of a probe that counts while the robot is lost."""
    return segments.value.milestone == "" and view.newest(OPEN, Level.GOAL) is not None


def milestone_sought(segments: Segments) -> tuple[str, ...]:
    return (segments.milestone,) if segments.milestone else ()


def milestone_and_segments(match: LineMatch) -> tuple[str, ...]:
    return (match.milestone, match.segments)


def match_solved(fix: PoseFix) -> tuple[str, ...]:
    return (fix.match,)


@dataclass(frozen=True, slots=True)
class Track:
    """A landmark point that is followed by template correlation (§5).

    Attributes:
        landmark: its name.
        point_world: (3,) [m].
        template_frame: id of the frame entry from which its template is cut.
        template_px: (2,) the template's centre in that frame.
        template_depth_m: distance along the optical axis then; the template is resampled by the ratio.
        predicted_px, found_px: (2,) in the newest frame; found_px is None where it was not found.
        peak: correlation there, -1..1.
        sigma_px: standard deviation of found_px.
        misses: how often it was not found in a row.
    """

    landmark: str
    point_world: tuple[float, float, float]
    template_frame: str
    template_px: tuple[float, float]
    template_depth_m: float
    predicted_px: tuple[float, float]
    found_px: tuple[float, float] | None
    peak: float
    sigma_px: float
    misses: int = 0

    @property
    def shift_px(self) -> tuple[float, float]:
        """How far right of and below its prediction it was found; (0, 0) where it was not."""
        u, v = self.found_px or self.predicted_px
        return u - self.predicted_px[0], v - self.predicted_px[1]

    def sentence(self) -> str:
        right, below = self.shift_px
        return (f"{words.landmark(self.landmark)} {abs(right):.1f} px {'right' if right >= 0 else 'left'} and"
                f" {abs(below):.1f} px {'below' if below >= 0 else 'above'} its prediction"
                f" (correlation {self.peak:.2f})")


@dataclass(frozen=True, slots=True)
class Anchor:
    """What was believed when templates were cut: what tracks tell is relative to it, and no surer than it was.

    Attributes:
        frame: id of the frame entry.
        x_m, y_m: where the robot was [m, world].
        covariance: over (x, y, heading), world.
    """

    frame: str
    x_m: float
    y_m: float
    covariance: Covariance


@inference(needs=template_frames)
@dataclass(frozen=True, slots=True)
class Tracks:
    """All landmarks that are followed, as of one frame.

    Attributes:
        frame: id of the frame entry.
        half_px: templates are squares of 2 half_px + 1.
        items: the tracks.
        anchors: one for each frame in which templates of these tracks were cut.
        taken: how many there were when new ones were last taken.
        unseen: in how many pictures, the last ones, none was found.
    """

    frame: str
    half_px: int
    items: tuple[Track, ...]
    anchors: tuple[Anchor, ...] = ()
    taken: int = 0
    unseen: int = 0

    def sentence(self) -> str:
        cut = [track for track in self.items if track.template_frame == self.frame]
        found, followed = self.found_again(), len(self.items) - len(cut)
        parts = [f"{len(found)} of {words.count(followed, 'landmark')} found again"] if followed else []
        parts += [f"{words.count(len(cut), 'landmark')} newly chosen"] if cut else []
        head = " and ".join(parts) or "no landmark is followed"
        return f"{head}; in {self.frame}" + "".join(f"; {track.sentence()}" for track in found[:3])

    def found_again(self) -> list[Track]:
        """The landmarks that were found again, the one furthest from its prediction first."""
        again = (t for t in self.items if t.found_px is not None and t.template_frame != self.frame)
        return sorted(again, key=lambda track: -math.hypot(*track.shift_px))


@inference(keep=LAST_SEGMENTS, unless=may_be_of_a_probe, needs=milestone_sought)
@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Line segments found in a frame (§1.2).

    Attributes:
        frame: id of the frame entry.
        milestone: id of the milestone entry for which they were sought, or "".
        segments_px: (n, 2, 2).
        sigma_px: (n,) standard deviation of their offset.
        contrast, brightness: of the frame: standard deviation and mean of its grey values, 0..255.
    """

    frame: str
    milestone: str
    segments_px: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    contrast: float
    brightness: float = 128.0

    def sentence(self) -> str:
        purpose = f" for {self.milestone}" if self.milestone else ""
        found = words.count(len(self.segments_px), "line segment")
        return f"{found} found; in {self.frame}{purpose}, contrast {self.contrast:.0f} of 255"


@inference(keep=2, needs=milestone_and_segments)
@dataclass(frozen=True, slots=True, eq=False)
class LineMatch:
    """Which segment belongs to which model line (§6.1).

    Attributes:
        milestone, segments: ids of the entries.
        pairs: (p, 2) index of the milestone's line, index of the segment.
        lines_world: (p, 2, 3), segments_px: (p, 2, 2): the pairs themselves.
        error: value of the objective function (§6.1.3).
        coverage: (m,) part of each expected line that is accounted for.
        is_camera_open: whether the camera may be mounted differently than was learnt of it, as after a knock.
    """

    milestone: str
    segments: str
    pairs: NDArray[np.int64]
    lines_world: NDArray[np.float64]
    segments_px: NDArray[np.float64]
    error: float
    coverage: NDArray[np.float64]
    is_camera_open: bool = False

    def sentence(self) -> str:
        segments = len(set(self.pairs.reshape(-1, 2)[:, 1].tolist()))
        return (f"{words.count(segments, 'segment')} paired with model lines; {self.segments} against {self.milestone},"
                f" match error {self.error:.3g}")


@inference(keep=2, needs=match_solved)
@dataclass(frozen=True, slots=True, eq=False)
class PoseFix:
    """The robot's pose from matched lines (§6.2).

    Attributes:
        match: id of the match entry.
        world_from_robot: the pose.
        covariance: (3, 3) over (x, y, heading), world.
        inliers: (p,) which pairs agree with it.
        residuals_px: (p, 2) distances of both segment ends from the projected model line.
        rejected: (p,) why a pair was rejected, "" for inliers.
        camera_step: (7,) by how much the camera differs from what is believed, as the lines say; () for as believed.
        camera_covariance: (7, 7) of the camera then. camera_chi2: squared distance from what was believed.
        protection: how far off it may be if one of the things that it rests on is false.
    """

    match: str
    world_from_robot: Pose2
    covariance: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    residuals_px: NDArray[np.float64]
    rejected: tuple[str, ...]
    camera_step: tuple[float, ...] = ()
    camera_covariance: tuple[tuple[float, ...], ...] = ()
    camera_chi2: float = 0.0
    protection: Protection = UNPROTECTED

    def sentence(self) -> str:
        pose = self.world_from_robot
        agree = f"{int(self.inliers.sum())} of {words.count(len(self.inliers), 'matched pair')} agree on one pose"
        return (f"{agree}; from {self.match} the robot stands at {words.point(pose.x_m, pose.y_m)}, heading"
                f" {words.degrees(pose.heading_rad)} in the world ({words.sigma(self.covariance.tolist())};"
                f" {self.protection.words()})")


@dataclass(frozen=True, slots=True)
class Glimpse:
    """One look round while lost.

    Attributes:
        segments: id of the entry of what was seen.
        now_from_then: where the robot was, from where it was at the newest look.
        covariance: of that, over (x, y, heading).
    """

    segments: str
    now_from_then: Pose2
    covariance: Covariance


@inference(keep=2)
@dataclass(frozen=True, slots=True)
class Panorama:
    """All looks since the robot is lost, composed by the motions between them; the newest last."""

    glimpses: tuple[Glimpse, ...]

    def sentence(self) -> str:
        return f"{words.count(len(self.glimpses), 'look')} round"
