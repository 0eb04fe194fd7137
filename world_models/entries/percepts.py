"""What perception puts on the board: tracks, segments, matches and pose fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from world_models.entries.location import Covariance
from world_models.frames import Pose2


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


@dataclass(frozen=True, slots=True)
class Tracks:
    """All landmarks that are followed, as of one frame.

    Attributes:
        frame: id of the frame entry.
        half_px: templates are squares of 2 half_px + 1.
        items: the tracks.
        anchors: one for each frame in which templates of these tracks were cut.
        taken: how many there were when new ones were last taken.
    """

    frame: str
    half_px: int
    items: tuple[Track, ...]
    anchors: tuple[Anchor, ...] = ()
    taken: int = 0


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


@dataclass(frozen=True, slots=True, eq=False)
class LineMatch:
    """Which segment belongs to which model line (§6.1).

    Attributes:
        milestone, segments: ids of the entries.
        pairs: (p, 2) index of the milestone's line, index of the segment.
        lines_world: (p, 2, 3), segments_px: (p, 2, 2): the pairs themselves.
        error: value of the objective function (§6.1.3).
        coverage: (m,) part of each expected line that is accounted for.
    """

    milestone: str
    segments: str
    pairs: NDArray[np.int64]
    lines_world: NDArray[np.float64]
    segments_px: NDArray[np.float64]
    error: float
    coverage: NDArray[np.float64]


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
    """

    match: str
    world_from_robot: Pose2
    covariance: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    residuals_px: NDArray[np.float64]
    rejected: tuple[str, ...]


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


@dataclass(frozen=True, slots=True)
class Panorama:
    """All looks since the robot is lost, composed by the motions between them.

    Attributes:
        glimpses: the newest last.
        found: what was made of them, in words.
    """

    glimpses: tuple[Glimpse, ...]
    found: str = ""
