"""One mission with a camera that is otherwise than told: how it ended, and what was learnt of the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard.journal import Decision
from experiments.generated.missions import CameraCase, write_camera_mission
from harvey.campaign.campaign import Task, run_task
from sim.faults.kinds import CameraKnocked
from sim.scenario import Scenario, load_scenario
from world_models.camera import CAMERA_UNKNOWNS, Camera, CameraMount, subtract_cameras
from world_models.entries.body import MotionReport
from world_models.entries.robot import CameraState

FAR_M = 10.0
"""Way after which the camera's state is judged; the end of the mission where it is shorter."""


@dataclass(frozen=True, slots=True)
class CameraTrial:
    """A mission.

    Attributes:
        case: how the camera is otherwise; floor: seed of the generated floor, and of all chance.
    """

    case: CameraCase
    floor: int


@dataclass(frozen=True, slots=True)
class CameraResult:
    """How a mission ended, in plain types.

    Attributes:
        told: error of what the robot was told of the camera, by :data:`CAMERA_UNKNOWNS`; found: of what it had learnt
            after 10 m; sigmas: what it stated for that.
        is_learnt: whether it had learnt anything; knocked: whether the knock had happened.
        gone_m: as the wheels claim.
    """

    case: str
    floor: int
    outcome: str
    reason: str
    error_m: float
    false_accepts: int
    relocations: int
    told: list[float]
    found: list[float]
    sigmas: list[float]
    is_learnt: bool
    is_knocked: bool
    gone_m: float
    robot_s: float
    wall_s: float


class _Watch:
    """A sink that keeps the camera's state after so much of the way, and at the end."""

    def __init__(self) -> None:
        self.gone_m = 0.0
        self.state: CameraState | None = None
        self.far: CameraState | None = None

    def __call__(self, decision: Decision) -> None:
        for change in (*decision.observed, *decision.made):
            value = change.entry.value
            if isinstance(value, MotionReport):
                self.gone_m += abs(value.move_m)
                if self.gone_m >= FAR_M and self.far is None:
                    self.far = self.state
            elif isinstance(value, CameraState):
                self.state = value


def run_camera_mission(trial: CameraTrial) -> CameraResult:
    """Run the mission of a trial."""
    watch = _Watch()
    with TemporaryDirectory() as folder:
        path = write_camera_mission(Path(folder), trial.floor, trial.case)
        scenario = load_scenario(path)
        r = run_task(Task(str(path), (), trial.floor), sinks=[watch])
    is_knocked = trial.case == "knocked" and not any("knocked" in words for words in r.amiss)
    camera, mount = find_true_camera(scenario, is_knocked)
    state = (watch.state if trial.case == "knocked" else watch.far) or watch.state
    told = subtract_cameras(scenario.camera.camera, scenario.camera.mount, camera, mount)
    found = told if state is None else subtract_cameras(state.lens, state.mount, camera, mount)
    is_learnt = state is not None and bool(state.covariance)
    sigmas = np.sqrt(np.diag(np.array(state.covariance))).tolist() if state is not None and is_learnt else []
    return CameraResult(
        trial.case, trial.floor, r.outcome, r.reason, r.error_m, r.false_accepts, r.relocalizations, list(told),
        list(found), sigmas or [math.inf] * len(CAMERA_UNKNOWNS), is_learnt, is_knocked, watch.gone_m, r.sim_time_s,
        r.wall_time_s)


def find_true_camera(scenario: Scenario, is_knocked: bool) -> tuple[Camera, CameraMount]:
    """The camera as it truly is at the end."""
    camera, mount = scenario.truth.camera.mounted(scenario.camera.camera, scenario.camera.mount)
    for knock in (f for f in scenario.faults if is_knocked and isinstance(f, CameraKnocked)):
        mount = CameraMount(mount.height_m, mount.forward_m, mount.tilt_rad + knock.tilt_rad,
                            mount.roll_rad + knock.roll_rad, mount.yaw_rad + knock.yaw_rad)
    return camera, mount
