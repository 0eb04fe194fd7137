"""How far off a pose may be although nothing says so: its protection level, by solution separation.

A covariance speaks of noise. It does not speak of a wall that stands elsewhere, of a belief that was pushed, or of
lines that were taken for their neighbours. So each thing that the pose rests on is left out in turn, and the pose is
solved for again. If that one thing is false, the truth is near the pose without it: as far as both poses differ, and as
the noise of the second one allows. The largest of these is the protection level, as aviation has it (receiver
autonomous integrity monitoring; multiple hypothesis solution separation, Blanch et al., 2012). What cannot be told
apart is in it: a pose that rests on one wall alone is no surer than what was believed before.

One thing is a landmark, a wall with all that is on it, all that is on one side, what is near or what is far; and the
belief. A wall, a side and a landmark are held against the belief as it is stated: the model is false there, and the
belief is not. What is near or far is held against a loosened belief: lines that were taken for their neighbours come
with a belief that was pushed, and they disagree with depth. A robot that was only just put down was not pushed. The
camera's own state is an unknown beside the pose, with what is known of it. How much the lines scatter is taken from the
picture itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.with_camera import FREE, POSE, UNKNOWNS, build_information, measure_lines
from world_models import words
from world_models.camera import Camera, CameraMount
from world_models.entries import ALERT_LIMIT_M, SHARED_SIGMA_M, Protection, count_sigmas
from world_models.frames import Pose2

LINE_SIGMA_PX = 0.45
"""Deviation of a segment's end across the line before the picture has said anything of it."""
LINE_SIGMA_FREEDOM = 10.0
"""Weight of that, in degrees of freedom."""
STATED_FACTOR = 4.0
"""Factor on a belief's covariance where something else is false: tails are longer than stated, but where put down."""
LEAST = np.diag(np.square([1e-4, 1e-4, 1e-5]))
"""Covariance of a belief that is stated to have none: a tenth of a millimetre, a hundredth of a milliradian."""
NOISE, BELIEF = "noise alone", "the belief before"
LEFT, RIGHT, NEAR, FAR = "what is on the left", "what is on the right", "what is near", "what is far"


class Rests(NamedTuple):
    """What a pose rests on.

    Attributes:
        lines_world: (n, 2, 3) [m] of the lines that agree; segments_px: (n, 2, 2); landmarks: n names.
        camera, mount: as it was solved for; step: (7,) from what was believed of it.
        belief: before; covariance: (3, 3) of it over (x, y, heading), as stated; loosened: as it may have been pushed;
            None: it was not.
        camera_covariance: (7, 7) of what was believed of the camera.
        seen_from: where the robot was when it saw each line, as looks of one turn round; none: at the pose itself.
        model_m: deviation of the model, where what is left is as far off as it is.
        excess: by how much the protection level of the belief is above that covariance [m, rad]: what is false now was
            so when it came to be believed.
        walls: by name, (n, 3) by how much each line moves with a wall along its normal, with all that is on it [m].
    """

    lines_world: Floats
    segments_px: Floats
    landmarks: Sequence[str]
    camera: Camera
    mount: CameraMount
    step: Floats
    belief: Pose2
    covariance: Floats
    loosened: Floats | None
    camera_covariance: Floats
    seen_from: Sequence[Pose2] = ()
    model_m: float = 0.0
    excess: tuple[float, float] = (0.0, 0.0)
    walls: Sequence[tuple[str, Floats]] = ()


def compute_protection(pose: Pose2, covariance: Floats, rests: Rests) -> Protection:
    """The protection level of a pose with a stated covariance (3, 3), world frame; linear near the pose."""
    if not len(rests.lines_world):
        return _measure(NOISE, np.zeros(POSE), covariance, count_sigmas(1))
    distances, slopes = _measure_lines(pose, rests)
    said = LINE_SIGMA_FREEDOM * LINE_SIGMA_PX**2 + float(np.sum(distances**2))  # as expected, and as the lines scatter
    variance = said / (LINE_SIGMA_FREEDOM + max(distances.size - POSE, 0))
    hessians = np.einsum("nea,neb->nab", slopes, slopes) / variance
    gradients = np.einsum("nea,ne->na", slopes, distances) / variance
    offset = np.concatenate([pose.minus(rests.belief), rests.step])[FREE]
    known = (1.0 if rests.loosened is None else STATED_FACTOR) * rests.covariance + LEAST
    factor = count_sigmas(6 + len(set(rests.landmarks)) + len(rests.walls))
    excess = np.diag(np.square([rests.excess[0], *rests.excess])) / factor**2
    stated, loosened = (build_information(prior + excess, rests.camera_covariance)[np.ix_(FREE, FREE)]
                        for prior in (known, known if rests.loosened is None else rests.loosened))
    camera, everything = np.array(loosened), np.ones(len(distances), bool)
    camera[:POSE, :POSE] = 0.0
    shared = np.diag(np.square([rests.model_m, rests.model_m, 0.0]))
    levels = [_measure(NOISE, np.zeros(POSE), covariance, factor)]
    left_out = ((name, rest, loosened if is_depth else stated) for name, rest, is_depth in _list_left_out(rests, pose))
    for name, rest, information in (*left_out, (BELIEF, everything, camera)):
        without = _invert(hessians[rest].sum(axis=0) + information)
        step = -(without @ (gradients[rest].sum(axis=0) + information @ offset))[:POSE]
        levels.append(_measure(name, step, without[:POSE, :POSE] + shared, factor))
    hessian, gradient = hessians.sum(axis=0) + stated, gradients.sum(axis=0) + stated @ offset
    for name, moved in rests.walls:  # where it stands is open: one unknown more, which is solved for and left out again
        by_wall = np.einsum("nea,na->ne", slopes[..., :2], -moved[:, :2]) / math.sqrt(variance)
        share, size = np.einsum("nea,ne->a", slopes, by_wall) / math.sqrt(variance), float(np.sum(by_wall**2)) + 1.0
        without = _invert(hessian - np.outer(share, share) / size)
        off = float(np.sum(by_wall * distances)) / math.sqrt(variance)
        step = -(without @ (gradient - share * off / size))[:POSE]
        levels.append(_measure(name, step, without[:POSE, :POSE] + shared, factor))
    worst = max(levels)
    return Protection(worst.place_m, max(level.heading_rad for level in levels), worst.doubted)


def _measure_lines(pose: Pose2, rests: Rests) -> tuple[Floats, Floats]:
    """Distances (n, 2) of the lines' ends [px], and their slopes (n, 2, u) by the pose and what is open of the camera.
    """
    n, c, m = len(rests.lines_world), rests.camera, rests.mount
    lens = np.array([c.fx, c.fy, c.cx, c.cy])
    mounted = np.array([m.height_m, m.forward_m, m.tilt_rad, m.roll_rad, m.yaw_rad])
    seen_from = rests.seen_from or (pose,) * n
    distances, slopes = np.zeros((n, 2)), np.zeros((n, 2, UNKNOWNS))
    for there in dict.fromkeys(seen_from):
        of = [one == there for one in seen_from]
        state = np.array([*there.vector, *np.zeros(UNKNOWNS - POSE)])
        distances[of], slopes[of] = measure_lines(np.ascontiguousarray(rests.lines_world[of]),
                                                  np.ascontiguousarray(rests.segments_px[of]), lens, mounted, state)
        lever = np.eye(POSE)  # of the pose there by the one now, to which it is fixed
        lever[0, 2], lever[1, 2] = pose.y_m - there.y_m, there.x_m - pose.x_m
        slopes[of, :, :POSE] = slopes[of, :, :POSE] @ lever
    return distances, np.asarray(slopes[..., FREE])


def tell_unavailable(protection: Protection) -> str:
    """That a place may be further off than the alert limit, in words."""
    doubted = words.landmark(protection.doubted)
    return (f"it may be {words.metres(protection.place_m)} off if {doubted} is not as it seems: the protection level is"
            f" above the alert limit of {words.metres(ALERT_LIMIT_M)}")


def _list_left_out(rests: Rests, pose: Pose2) -> Iterator[tuple[str, Mask, bool]]:
    """What may be false, by its name: the lines (n,) that are left without it, and whether it is told by depth.

    Each landmark, what is on each side of the robot, and the nearer half of the lines and the farther one.
    """
    names, (x_m, y_m) = np.asarray(rests.landmarks), (rests.lines_world[..., :2].mean(axis=1) - pose.position).T
    is_left = math.cos(pose.heading_rad) * y_m - math.sin(pose.heading_rad) * x_m > 0.0
    once = np.unique(rests.lines_world.reshape(-1, 6), axis=0, return_index=True)[1]  # one line is seen in many pieces
    is_far = (away_m := np.hypot(x_m, y_m)) > np.median(away_m[once])
    yield from ((name, names != name, False) for name in dict.fromkeys(rests.landmarks))
    yield from ((LEFT, ~is_left, False), (RIGHT, is_left, False), (NEAR, is_far, True), (FAR, ~is_far, True))


def _measure(name: str, step: Floats, covariance: Floats, factor: float) -> Protection:
    """The level where ``name`` is false: the pose without it is ``step`` (3,) away, and has this covariance."""
    variance = max(0.0, float(np.linalg.eigvalsh(covariance[:2, :2])[-1])) + SHARED_SIGMA_M**2
    sigma_rad = math.sqrt(max(0.0, float(covariance[2, 2])))
    return Protection(
        math.hypot(step[0], step[1]) + factor * math.sqrt(variance), abs(float(step[2])) + factor * sigma_rad, name)


def _invert(information: Floats) -> Floats:
    """Inverse (u, u) of unknowns of different units; what is left open is very uncertain."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-9)) @ vectors.T
    return np.asarray(inverse / np.outer(scale, scale))
