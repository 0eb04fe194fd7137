"""The robot as it truly is, as Harvey believes it is, and how sure it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from logs.recording.logger import Logger, Moment, Panel
from logs.recording.loggers.surroundings.model_building import space_view
from logs.recording.palette import BELIEVED, CANDIDATE, TRUE, Colour, faint
from logs.recording.paths import (
    BELIEVED_BODY,
    BELIEVED_ROBOT,
    BELIEVED_TRAIL,
    CANDIDATES,
    NAMES,
    TRUE_ROBOT,
    TRUE_TRAIL,
)
from logs.recording.stream import RecordingStream
from world_models.camera import Camera
from world_models.entries import Hypothesis
from world_models.frames import Pose2, frozen

RADIUS_M = 0.35
"""Of the Denning platform."""
SIGMA_SCALE = 20.0
"""A few centimetres would not show in a building: the ellipse is drawn larger, and its label says so."""
RING_HEIGHT_M = 1.5
"""Above the robot, which would hide a small ring."""
STILL_M = 1e-3
TRAIL_HEIGHT_M = 0.2
CIRCLE = frozen([np.cos(np.linspace(0.0, 2.0 * np.pi, 33)), np.sin(np.linspace(0.0, 2.0 * np.pi, 33))])
SIGHT_M = 2.5
"""Length of the wedge that shows where the camera looks."""
CLOSE_ABOVE_M, CLOSE_SOUTH_M = 6.0, 1.2
"""The eye of the near view: above the robot, and to the south."""


class Robots(Logger):
    """Logs both robots when they move."""

    _has_candidates = False

    def panels(self) -> Sequence[Panel]:
        """The building from near by; the eye goes with the believed robot."""
        eye = rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=[0.0, -CLOSE_SOUTH_M, CLOSE_ABOVE_M], look_target=[0.0, 0.0, 0.0],
            eye_up=[0.0, 0.0, 1.0], tracking_entity=f"/{BELIEVED_BODY}")
        return (Panel(space_view("Close by", eye, f"- /{NAMES}"), "decisions", 3, 6),)

    def begin(self, stream: RecordingStream) -> None:
        wires = rr.components.FillMode.MajorWireframe
        stream.fix(BELIEVED_BODY, _cylinder(BELIEVED, RADIUS_M + 0.08, 1.3, wires))
        stream.fix(f"{BELIEVED_ROBOT}/heading", _arrow(BELIEVED, 1.35))
        stream.fix(f"{BELIEVED_ROBOT}/sight", _wedge(self.subject.camera, self.subject.mount.forward_m))
        stream.fix(BELIEVED_TRAIL, rr.LineStrips3D.from_fields(colors=[BELIEVED], radii=0.04))
        label = f"1 sigma, drawn {SIGMA_SCALE:.0f} times as large"
        stream.fix(BELIEVED_ROBOT, rr.LineStrips3D.from_fields(
            colors=[BELIEVED], radii=0.025, labels=[label], show_labels=False))
        stream.fix(CANDIDATES, rr.Arrows3D.from_fields(colors=[CANDIDATE], radii=0.05, show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if moment.truth is not None:
            if TRUE_ROBOT not in self._last:  # it has a shape only where somebody knows where it is
                stream.fix(f"{TRUE_ROBOT}/body", _cylinder(TRUE, RADIUS_M, 0.9, rr.components.FillMode.Solid))
                stream.fix(f"{TRUE_ROBOT}/heading", _arrow(TRUE, 0.95))
                stream.fix(TRUE_TRAIL, rr.LineStrips3D.from_fields(colors=[TRUE], radii=0.04))
            self._move(stream, TRUE_ROBOT, TRUE_TRAIL, moment.truth)
        if not moment.touched(Hypothesis):
            return
        self._log_candidates(stream, [e.value for e in moment.mirror.all(Hypothesis) if e.value.status == "candidate"])
        if (held := moment.held) is not None:
            points = ring(held.world_from_robot, held.value.covariance_world(self.subject.world))
            strip = np.insert(points, 2, RING_HEIGHT_M, axis=1)
            stream.log(BELIEVED_ROBOT, rr.LineStrips3D, strips=strip[None].astype(np.float32))
            self._move(stream, BELIEVED_ROBOT, BELIEVED_TRAIL, held.world_from_robot)

    def _log_candidates(self, stream: RecordingStream, others: Sequence[Hypothesis]) -> None:
        """Where else it might be: an arrow each, the longer the likelier."""
        if not others and not self._has_candidates:
            return
        self._has_candidates = bool(others)
        poses = [h.world_from_robot(self.subject.world) for h in others]
        vectors = [((0.5 + h.weight) * math.cos(p.heading_rad), (0.5 + h.weight) * math.sin(p.heading_rad), 0.0)
                   for h, p in zip(others, poses, strict=True)]
        stream.log(CANDIDATES, rr.Arrows3D, origins=[(p.x_m, p.y_m, RING_HEIGHT_M) for p in poses], vectors=vectors,
                   labels=[f"{h.weight:.0%}" for h in others])

    def _move(self, stream: RecordingStream, robot: str, trail: str, pose: Pose2) -> None:
        before = self._last.get(robot)
        if not self.is_new(robot, pose):
            return
        turn = (0.0, 0.0, math.sin(pose.heading_rad / 2), math.cos(pose.heading_rad / 2))
        stream.log(robot, rr.Transform3D, translation=[(pose.x_m, pose.y_m, 0.0)], quaternion=[turn])
        if isinstance(before, Pose2) and before.distance_to(pose) > STILL_M:
            step = [[(p.x_m, p.y_m, TRAIL_HEIGHT_M) for p in (before, pose)]]
            stream.log(trail, rr.LineStrips3D, strips=np.array(step, np.float32))


def _cylinder(colour: Colour, radius_m: float, height_m: float, fill: Any) -> Any:
    return rr.Cylinders3D(
        lengths=[height_m], radii=[radius_m], centers=[[0, 0, height_m / 2]], colors=[colour], fill_mode=fill)


def _arrow(colour: Colour, height_m: float) -> Any:
    return rr.Arrows3D(origins=[[0, 0, height_m]], vectors=[[0.9, 0, 0]], radii=0.06, colors=[colour])


def _wedge(camera: Camera, forward_m: float) -> Any:
    """What the camera covers, on the floor ahead."""
    half_view_rad = np.arctan(camera.width / (2.0 * camera.fx))
    angles = np.linspace(-half_view_rad, half_view_rad, 9)
    arc = [[forward_m + SIGHT_M * np.cos(a), SIGHT_M * np.sin(a), 0.04] for a in angles]
    apex = [forward_m, 0.0, 0.04]
    return rr.LineStrips3D([[apex, *arc, apex]], colors=[faint(BELIEVED, 120)], radii=0.015)


def ring(pose: Pose2, covariance_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) one standard deviation of the position, enlarged, round the robot in the robot's own frame [m]."""
    (a, b), (_, d) = covariance_world[:2, :2].tolist()
    along = math.sqrt(max(a, 0.0))  # Cholesky's root of the matrix takes the circle to the ellipse
    across = b / along if along > 0.0 else 0.0
    root = np.array([[along, 0.0], [across, math.sqrt(max(d - across**2, 0.0))]])
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    robot_from_world = np.array([[c, s], [-s, c]])
    return np.asarray((SIGMA_SCALE * (robot_from_world @ root) @ CIRCLE).T)


LOGGERS = (Robots,)
