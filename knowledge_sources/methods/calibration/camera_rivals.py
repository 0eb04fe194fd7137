"""What explains that lines lie beside where a pose has them: the lens, the focal length, the mounting, or a wall?

A wrong term of the lens moves a pose by decimetres and leaves residuals of half a pixel, which no verdict minds. They
grow with the cube of the distance from the centre, as no pose, no mounting and no wall makes them grow. All rivals are
weighed by one linear model of Gaussian unknowns: by how much is the picture likelier where one of them is open too?
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import hedge
from knowledge_sources.methods.pose.with_camera import measure_lines
from world_models.camera import Camera, CameraMount
from world_models.entries import SHARED_SIGMA_M, Explanation
from world_models.entries.difference import RivalKind
from world_models.frames import Pose2

NEAR_PX = 6.0
"""Lines further off than this are of something else."""
MIN_LINES = 20
SIGMA_PX, HUBER_PX = 0.35, 1.0
"""Of the ends of a segment; beyond the latter they count less (Huber)."""
OPEN_POSE = (0.5, 0.5, 0.5)
"""Standard deviations of the pose [m, m, rad]: the lines tell it."""
SIGMA_K1, SIGMA_FOCAL, SIGMA_TURN_RAD, SIGMA_HEIGHT_M, SIGMA_WALL_M = 0.1, 0.05, 0.05, 0.1, 0.1
"""How far off each may be, one standard deviation, where it is wrong."""
KNOWN_K1 = 0.007
"""How well a stated lens is known: in a corridor so much moves a place by ``SHARED_SIGMA_M``."""
POSE, TILT, ROLL, YAW, HEIGHT, FOCAL, CX, CY = 3, 3, 4, 5, 6, 7, 8, 9

WHAT: Mapping[RivalKind, str] = {
    "lens": "a lens whose first term is {0:+.3f} more than stated", "focal length": "a focal length {0:+.1%} longer",
    "mounting": "a camera that looks {1:+.1f} degrees lower", "wall": "{2}, which stands elsewhere"}


class SeenLines(NamedTuple):
    """Lines and the segments that were matched to them, with the pose that they told.

    Attributes:
        lines_world: (n, 2, 3) [m]. segments_px: (n, 2, 2), rectified. landmarks: (n,) what each line is of.
        pose: world. camera, mount: as believed. step: (7,) of the camera with which the pose was found.
        known: (7, 7) covariance of the camera, over :data:`~world_models.camera.CAMERA_UNKNOWNS`.
    """

    lines_world: Floats
    segments_px: Floats
    landmarks: Sequence[str]
    pose: Pose2
    camera: Camera
    mount: CameraMount
    step: Floats
    known: Floats


class Opened(NamedTuple):
    """What a picture says with one rival open.

    Attributes:
        log_ratio: by how much it is likelier with it. off, sigma: of its first unknown, in its unit.
        name: of the wall, where the rival is one.
    """

    log_ratio: float
    off: float
    sigma: float
    name: str = ""


def open_rivals(seen: SeenLines) -> Mapping[RivalKind, Opened]:
    """What each rival makes of the residuals; nothing where too few lines lie near."""
    state = np.array([seen.pose.x_m, seen.pose.y_m, seen.pose.heading_rad, *seen.step])
    c, m = seen.camera, seen.mount
    distances, slopes = measure_lines(
        np.ascontiguousarray(seen.lines_world, float), np.ascontiguousarray(seen.segments_px, float),
        np.array([c.fx, c.fy, c.cx, c.cy]), np.array([m.height_m, m.forward_m, m.tilt_rad, m.roll_rad, m.yaw_rad]),
        state)
    near = np.abs(distances).max(axis=1) <= NEAR_PX
    if np.count_nonzero(near) < MIN_LINES:
        return {}
    names = np.array(list(seen.landmarks))[near]
    slope, bend = slopes[near].reshape(-1, len(state)), _bend(seen, slopes)[near].ravel()
    off = distances[near].ravel() - slope[:, POSE:] @ seen.step  # with the camera as it is believed
    of = {name: np.repeat(names == name, 2)[:, None] * -slope[:, :2] for name in sorted(set(names.tolist()))}
    known = [(slope[:, :POSE], np.diag(np.square(OPEN_POSE))), (slope[:, POSE:], seen.known)]
    known += [(bend[:, None], np.eye(1) * KNOWN_K1**2)]
    known += [(moved, np.eye(2) * SHARED_SIGMA_M**2) for moved in of.values()]
    given = _Likelihood(off, known, bend)
    turned = SIGMA_TURN_RAD, SIGMA_TURN_RAD, SIGMA_HEIGHT_M
    walls = [given.open(moved, (SIGMA_WALL_M, SIGMA_WALL_M))._replace(name=name) for name, moved in of.items()]
    best = max(walls, key=lambda wall: wall.log_ratio)
    return {"lens": given.open(bend[:, None], (SIGMA_K1,)),
            "focal length": given.open(slope[:, [FOCAL]], (SIGMA_FOCAL,)),
            "mounting": given.open(slope[:, [TILT, ROLL, HEIGHT]], turned),
            "wall": best._replace(log_ratio=best.log_ratio - math.log(len(walls)))}


def explain(opened: Mapping[RivalKind, Opened]) -> tuple[Explanation, ...]:
    """The rivals in words, with what is left of their log ratios where the picture may be misread."""
    if not opened:
        return ()
    left = hedge({kind: one.log_ratio for kind, one in opened.items()})
    return (Explanation("chance", "chance", 0.0), *(
        Explanation(kind, WHAT[kind].format(one.off, math.degrees(one.off), one.name), left[kind], one.off, one.sigma)
        for kind, one in opened.items()))


def _bend(seen: SeenLines, slopes: Floats) -> Floats:
    """(n, 2) by how much distances grow with the first term of the lens: it bends ends toward the centre."""
    c = seen.camera
    plane = (seen.segments_px - (c.cx, c.cy)) / (c.fx, c.fy)
    moved = plane * np.sum(plane**2, axis=-1, keepdims=True) * (c.fx, c.fy)
    return np.asarray(slopes[..., CX] * moved[..., 0] + slopes[..., CY] * moved[..., 1])


class _Likelihood:
    """Residuals (n,) [px] as a Gaussian of what is known, with noise as large as they leave where all is open."""

    def __init__(self, off: Floats, known: Sequence[tuple[Floats, Floats]], bend: Floats) -> None:
        self._off, width = off, HUBER_PX
        spread = np.sum([slope @ covariance @ slope.T for slope, covariance in known], axis=0)
        full = spread + SIGMA_K1**2 * np.outer(bend, bend)
        noise = np.full(len(off), SIGMA_PX**2)
        for _ in range(3):
            rest = noise * np.linalg.solve(full + np.diag(noise), off)
            noise = SIGMA_PX**2 * np.maximum(1.0, np.abs(rest) / width)
        scatter = max(1.0, float(np.mean(rest**2 / noise)))
        self._inverse = np.linalg.inv(spread + scatter * np.diag(noise))

    def open(self, columns: Floats, sigmas: Sequence[float]) -> Opened:
        """With unknowns open, of columns (n, k) and standard deviations (k,)."""
        weighed = columns.T @ self._inverse
        told, prior = weighed @ columns, np.diag(np.square(sigmas))
        after = np.linalg.inv(told + np.linalg.inv(prior))
        mean = -after @ weighed @ self._off
        gain = 0.5 * float(mean @ np.linalg.solve(after, mean))
        cost = 0.5 * float(np.linalg.slogdet(np.eye(len(sigmas)) + prior @ told)[1])
        return Opened(gain - cost, float(mean[0]), math.sqrt(float(after[0, 0])))
