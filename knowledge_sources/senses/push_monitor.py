"""Push monitor (§4): a step between two looks that the wheels did not make, and that later looks find again."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import islice

import numpy as np

from blackboard import Change, Effect, Entry, Post, Posted, View, Watch, rule
from knowledge_sources.methods.belief import hedge
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.priority import Priority
from knowledge_sources.reads import CAMERA, HELD, add_reports
from knowledge_sources.reads.motion_between import SHARED_SIGMA_RAD, is_broken, list_reports
from knowledge_sources.reads.questions import WORTH_TELLING
from world_models.building.locale_frame import FrameRequest
from world_models.camera import YAW
from world_models.entries import SHARED_SIGMA_M, Drift, Evidence, Explanation, FloorView
from world_models.frames import Pose2

PUSHED, MAX_SIGMA_M, SHARED = 0.1, 0.015, np.square([SHARED_SIGMA_M, SHARED_SIGMA_M, SHARED_SIGMA_RAD])
"""How far a robot is pushed, or slips, one standard deviation [m, rad]; looks that tell less of a place are passed."""


def find_step(view: View, trigger: Change) -> Post | None:
    """What the last four looks tell of a step between the second and the third; None where there is none.

    Two pairs of looks, all different, must show the same step: that both are misread alike is next to impossible. What
    is so before it and after it too is no step, as of wheels that go otherwise.
    """
    looks = list(islice((one for one in view.newest_first(FloorView) if one.value.sigma_m <= MAX_SIGMA_M), 4))
    if len(looks) < 4 or looks[0] is not trigger.entry:
        return None
    d, c, b, a = looks
    steps = [step for pair in ((b, c), (a, d), (a, b), (c, d)) if (step := _weigh(view, *pair)) is not None]
    if len(steps) < 4:
        return None
    (off_m, inner), (_, outer), (_, before), (_, after) = steps
    if min(inner, outer) - max(before, after, 0.0) <= WORTH_TELLING:
        return None
    at, what = d.value, f"a robot that was pushed by {100.0 * off_m:.0f} cm, or slipped so far"
    explained = Explanation("chance", "chance", 0.0), Explanation("pushed", what, inner + outer)
    shows = f"it came {100.0 * off_m:.0f} cm beside where its wheels took it, and looks before and after agree"
    return Post(Evidence(f"the way from {b.id} to {c.id}", shows, explained, at.x_m, at.y_m, at.heading_rad, 0.0, 0.0,
                         at.seen_s), (d, c, b, a))


def _weigh(view: View, then: Entry[FloorView], now: Entry[FloorView]) -> tuple[float, float] | None:
    """How far the robot came beside where its wheels took it [m], and by how much a push explains that better than
    chance [log]; None where the wheels do not tell the way.
    """
    reports, drift = list_reports(view, then.value.motion, now.value.motion), view.latest(Drift)
    if not reports or drift is None or any(is_broken(view, report) for report in reports):
        return None
    actuator, told = HELD.of(view).robot.actuator, [report.value for report in reports]
    rolled = add_reports(actuator, drift.value, told).moved
    began, ended = (Pose2(one.value.x_m, one.value.y_m, one.value.heading_rad) for one in (then, now))
    camera, seen = CAMERA.of(view), began.inverse() @ ended
    arm = np.array([[1.0, 0.0, -seen.y_m], [0.0, 1.0, seen.x_m], [0.0, 0.0, 1.0]])  # a heading moves the far end
    first, last = (np.diag(np.square([one.value.sigma_m, one.value.sigma_m, one.value.sigma_rad]) + SHARED)
                   for one in (then, now))
    bent = math.hypot(drift.value.sigma_per_m, actuator.bend_sigma_per_m)
    wheels = replace(actuator, curvature_sigma_per_m=bent).motion_covariance(
        math.fsum(abs(one.turn_rad) for one in told), math.fsum(abs(one.move_m) for one in told))
    first[2, 2] += 4.0 * compute_camera_covariance(camera.value)[YAW, YAW] * (then.cycle < camera.cycle)
    off, spread = seen.minus(rolled), wheels + arm @ first @ arm.T + last  # headings are the camera's
    plain, pushed = (off @ np.linalg.solve(wide, off) + np.linalg.slogdet(wide)[1]
                     for wide in (spread, spread + PUSHED**2 * np.eye(3)))
    return float(np.linalg.norm(off[:2])), hedge({"pushed": 0.5 * float(plain - pushed)})["pushed"]


@rule(on=Watch(FloorView, (Posted,)), writes=(Evidence, FrameRequest), needs=(HELD, CAMERA), bind=find_step,
      priority=Priority.ENTER)
def push_monitor(_view: View, case: Post) -> Iterable[Effect]:
    """Says where the robot was pushed, or its wheels slipped, though a look has set that right."""
    yield case
