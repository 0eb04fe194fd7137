"""Camera calibrator (§3.2): learns the camera's own state from the milestones that are verified."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from blackboard import Change, Effect, Entry, Level, Posted, Revise, View, Watch, rule
from knowledge_sources.methods.calibration import compute_camera_covariance, learn
from knowledge_sources.priority import Priority
from knowledge_sources.reads import CAMERA
from world_models.building.locale_frame import FrameRequest
from world_models.camera import YAW
from world_models.entries import CameraState, Certificate, PoseFix, Travel, begin_travel

Verified = tuple[Entry[Certificate], Entry[PoseFix]]


def find_learnt(view: View, trigger: Change) -> Verified | None:
    """A verified milestone whose pose fix says something of the camera."""
    fix = view.get(trigger.entry.value.fix)
    return None if fix is None or not fix.value.camera_step else (trigger.entry, fix)


@rule(on=Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"), writes=(CameraState, Travel, FrameRequest),
      needs=(CAMERA,), bind=find_learnt, priority=Priority.ENTER, level=Level.PLAN)
def camera_calibrator(view: View, case: Verified) -> Iterable[Effect]:
    """Takes over what the lines of a verified milestone say of the camera: tilt, roll, height, lens.

    The pose was solved for with the same camera, so it acts before the plan adjuster takes the pose over. After a knock
    the yaw is open again, and the way by which it was learnt ends.
    """
    (certificate, fix), camera = case, CAMERA.of(view)
    f = fix.value
    state = learn(camera.value, f.camera_step, np.array(f.camera_covariance), f.world_from_robot)
    learnt = Revise(camera, state, (certificate, fix, camera))
    yield learnt
    before = compute_camera_covariance(camera.value)[YAW, YAW]
    travel, variance = view.latest(Travel), state.covariance[YAW][YAW]
    if travel is not None and variance > before:
        way = begin_travel(f.world_from_robot, f.covariance, state.mount.yaw_rad, variance)
        yield Revise(travel, way, (learnt,))
