"""Missions with a camera that is mounted otherwise than told, or knocked on the way: is it found, and is it survived?

Tilt, roll and yaw are up to 3 degrees off, the height up to 8 cm, the focal length up to 4 %, all at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard.journal import Decision
from experiments.generated.missions import CAMERA_CASES, CameraCase, write_camera_mission
from experiments.report import Cell, Report
from experiments.trials import RESULTS, at_least, at_most, campaign_folder, run_trials
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


MISSIONS, QUICK_MISSIONS = 1_000, 2
FIRST_SEED, SEEDS_APART = 100_000, 10_000
"""Seeds below 1,000 are for development: constants were chosen on some of them."""
PARTS: Mapping[CameraCase, float] = {"as told": 0.2, "miscalibrated": 0.5, "knocked": 0.3}
INCH_M = 0.0254
MIN_REACHED: Mapping[CameraCase, float] = {"as told": 0.99, "miscalibrated": 0.99, "knocked": 0.97}
MIN_FOUND, MAX_TILT_RAD, MAX_YAW_RAD, MAX_HEIGHT_M = 0.95, math.radians(0.05), math.radians(0.5), 0.005
"""How well the camera is to be known, and in which part of the missions; the yaw is the hardest."""
MIN_WITHIN = 0.93
"""Least part of what was learnt that is within two standard deviations."""
TILT, YAW, HEIGHT = (CAMERA_UNKNOWNS.index(name) for name in ("tilt_rad", "yaw_rad", "height_m"))
WORST_SHOWN = 6
COLUMNS = ("camera", "paper", "peer", "missions", "within an inch", "proves at least", "false accepts", "tilt off deg",
           "yaw off deg", "height off mm", "in 2 sigma", "relocated", "robot's mean s", "mean CPU s")


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive each case's share of so many missions, of seeds 100,000 + 10,000 ``seed`` + 0, 1, ...."""
    number = missions or (QUICK_MISSIONS if quick else MISSIONS)
    first = FIRST_SEED + SEEDS_APART * seed
    trials = [CameraTrial(case, first + k) for case in CAMERA_CASES
              for k in range(math.ceil(number * PARTS[case] - 1e-9))]
    folder = campaign_folder(f"miscalibrated-{missions}" if missions else "miscalibrated", seed, quick=quick)
    ends = run_trials(run_camera_mission, trials, CameraResult, folder, "mission")
    found = {case: [end for end in ends if end.case == case] for case in CAMERA_CASES}
    report = Report(
        "Missions with a camera that is not mounted as told", COLUMNS,
        tuple(_row(case, e) for case, e in found.items()),
        notes=(
            f"Seeds {first} to {max(trial.floor for trial in trials)}; no constant was chosen on them. Bounds are"
            " one-sided, of 95 %, by Clopper and Pearson.",
            "Off: median error of what was learnt within 10 m of way (of a knocked camera: by the end). in 2 sigma: of"
            " tilt, roll, yaw, height and focal length, one of each a mission. false accepts: milestones verified"
            " while the robot was elsewhere.",
            "The paper calls for an accurate sensor model (§3.2) and has no figure; a peer that navigates by a"
            " building's lines and learns its camera's mounting is not known.",
            *(line for case, e in found.items() for line in _worst(case, e)),
            f"One line per mission: {folder / RESULTS}",
        ),
        claims=tuple(_claims(found)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def is_right(end: CameraResult) -> bool:
    """Whether a mission reached its goal within an inch."""
    return end.outcome == "reached" and end.error_m <= INCH_M


def _row(case: str, ends: Sequence[CameraResult]) -> tuple[Cell, ...]:
    right = sum(map(is_right, ends))
    return (
        case, None, None, len(ends), right, f"{at_least(right, len(ends)):.1%}", sum(e.false_accepts for e in ends),
        math.degrees(_median(ends, TILT)), math.degrees(_median(ends, YAW)), 1000.0 * _median(ends, HEIGHT),
        f"{_share_within(ends):.0%}", sum(e.relocations for e in ends), math.fsum(e.robot_s for e in ends) / len(ends),
        math.fsum(e.wall_s for e in ends) / len(ends),
    )


def _median(ends: Sequence[CameraResult], unknown: int) -> float:
    return float(np.median([abs(e.found[unknown]) for e in ends]))


def _share_within(ends: Sequence[CameraResult]) -> float:
    """Which part of what was learnt is within two standard deviations."""
    learnt = [e for e in ends if e.is_learnt]
    if not learnt:
        return 1.0
    off = np.abs([e.found[: HEIGHT + 2] for e in learnt]) <= 2.0 * np.array([e.sigmas[: HEIGHT + 2] for e in learnt])
    return float(np.mean(off))


def _claims(found: Mapping[CameraCase, Sequence[CameraResult]]) -> Iterator[tuple[str, bool]]:
    everywhere = [e for ends in found.values() for e in ends]
    accepts = sum(bool(e.false_accepts) for e in everywhere)
    yield (f"no milestone is accepted at a wrong place: {accepts} of {len(everywhere)} missions, so in at most"
           f" {at_most(accepts, len(everywhere)):.2%}", not accepts)
    for case, ends in found.items():
        right = sum(map(is_right, ends))
        yield (f"{case}: at least {MIN_REACHED[case]:.0%} reach within an inch: {right} of {len(ends)}, so at least"
               f" {at_least(right, len(ends)):.1%}", right >= MIN_REACHED[case] * len(ends))
    wrong = [e for e in found["miscalibrated"] if e.is_learnt]
    for what, unknown, limit, unit in (
            ("tilt", TILT, MAX_TILT_RAD, "0.05 degrees"), ("yaw", YAW, MAX_YAW_RAD, "half a degree"),
            ("height", HEIGHT, MAX_HEIGHT_M, "5 mm")):
        near = sum(abs(e.found[unknown]) <= limit for e in wrong)
        yield (f"miscalibrated: {what} is found to {unit} within 10 m in at least {MIN_FOUND:.0%}: in {near} of"
               f" {len(wrong)} missions", near >= MIN_FOUND * len(wrong))
    share = _share_within(everywhere)
    yield f"what was learnt is within 2 sigma in at least {MIN_WITHIN:.0%}: in {share:.1%}", share >= MIN_WITHIN


def _worst(case: str, ends: Sequence[CameraResult]) -> list[str]:
    """Name the floors to look at."""
    flawed = [e for e in ends if not is_right(e) or e.false_accepts][:WORST_SHOWN]
    told = "; ".join(f"{e.floor} ({e.outcome}: {e.reason}; {1000.0 * e.error_m:.0f} mm off)" for e in flawed)
    return [f"{case}, floors to look at: {told}"] if flawed else []
