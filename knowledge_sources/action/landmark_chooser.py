"""Landmark chooser (§5): once the robot knows again where it is, it follows other landmarks."""

from __future__ import annotations

from collections.abc import Iterable

from blackboard import Change, Effect, Level, Revise, Revised, View, Watch, rule
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    HELD,
    MEASURED,
    NOT_LOST,
    PICTURE,
    Following,
    find_camera,
    post_or_revise,
    rectify,
    rests_on,
    take_new,
)
from world_models.building.locale_frame import FrameRequest
from world_models.entries import Drift, Hypothesis, Tracks


def find_followed_so_far(view: View, _trigger: Change) -> Following:
    return Following(PICTURE.of(view), HELD.of(view), view.latest(Tracks))


@rule(on=Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),
      writes=(Tracks, Hypothesis, Drift, FrameRequest), needs=(HELD, PICTURE, NOT_LOST, MEASURED),
      bind=find_followed_so_far, priority=Priority.CORRECT, closes=Level.ACTION)
def landmark_chooser(view: View, case: Following) -> Iterable[Effect]:
    """Takes all landmarks again after a milestone or a relocalization.

    The belief is aligned with the model's edges by a newer picture only: what a picture tells of the pose counts once.
    """
    frame, held, old = case
    belief = held.entry
    camera = None if rests_on(view, belief, frame.id) else compute_camera_covariance(
        find_camera(view))
    fresh = take_new(held, frame.id, rectify(held.robot, frame), (), (), belief.value, camera)
    tracks = post_or_revise(old, fresh.tracks, (frame, belief))
    yield tracks
    drift = view.latest(Drift)
    if drift is not None:
        heading = fresh.hypothesis.world_from_robot(held.world).heading_rad
        yield Revise(drift, drift.value.restart(heading), (tracks,))
    if fresh.hypothesis is not belief.value:
        yield Revise(belief, fresh.hypothesis, (frame, belief, tracks))
