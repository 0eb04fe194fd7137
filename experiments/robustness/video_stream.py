"""A mission's camera stream as a video file, seen once more through OpenCV's VideoCapture: the same milestones?

A mission is driven in the simulator. What its camera delivered is written to video files; then the same mission is
driven by a body that repeats the recorded motions, and looks through :class:`VideoCamera` at the video.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from blackboard.journal import Decision
from experiments.report import Cell, Report
from harvey.hardware.drivers.cameras.video_camera import CameraFault, VideoCamera
from harvey.hardware.drivers.cameras.video_file import write_video
from harvey.runner.ports import Body
from harvey.simulation.run import run_mission
from sim.scenario import load_scenario, with_settings
from sim.stage import Stage, build_stage
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Ride, RideReport
from world_models.entries.percepts import PoseFix
from world_models.entries.task import Certificate, Outcome
from world_models.frames import Pose2, wrap_angle

SCENARIO = "lab-to-allens-office"
QUICK_SCENARIO, QUICK_GOAL = "forty-foot-hallway", "(ptrans (hallway (4,4,0)) (hallway (14,4,0)))"
LOSSLESS_M, LOSSY_M, LOSSY_RAD = 1e-9, 0.01, math.radians(0.5)
COLUMNS = ("video", "MB", "looks", "milestones", "same verdicts", "pose differs by mm", "degrees", "outcome")


@dataclass(eq=False)
class Told:
    """What a mission came to: verdicts and pose fixes in their order, and the outcome."""

    verdicts: list[str] = field(default_factory=list)
    poses: list[Pose2] = field(default_factory=list)
    outcome: str = ""

    def __call__(self, decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Certificate) and change.entry.revision == 0:
                self.verdicts.append(value.verdict)
            elif isinstance(value, PoseFix):
                self.poses.append(value.world_from_robot)
            elif isinstance(value, Outcome):
                self.outcome = value.kind


class Recording:
    """A body whose answers are kept."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self.motions: list[MotionReport | BodyFault] = []
        self.frames: list[Frame] = []

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """As the body does."""
        self.motions.append(self._body.execute(command))
        return self.motions[-1]

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        """As the body does."""
        return self._body.steer(course)

    def claim(self) -> MotionReport | BodyFault:
        """As the body does."""
        return self._body.claim()

    def look(self, purpose: str) -> Frame | BodyFault:
        """As the body does."""
        found = self._body.look(purpose)
        if isinstance(found, Frame):
            self.frames.append(found)
        return found

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """As the body does."""
        return self._body.ride(ride)

    def wait(self, duration_s: float) -> float:
        """As the body does."""
        return self._body.wait(duration_s)

    def stop(self) -> None:
        """As the body does."""
        self._body.stop()


class Repeating:
    """A body that answers commands with recorded motions, in their order, and looks with a camera."""

    def __init__(self, motions: list[MotionReport | BodyFault], camera: VideoCamera) -> None:
        self._motions: Iterator[MotionReport | BodyFault] = iter(motions)
        self._camera = camera

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """The next recorded motion, whatever is asked for."""
        return next(self._motions, None) or BodyFault("base", "link lost", "the recorded motions end here", "", 0.0)

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        """None is recorded."""
        return BodyFault("base", "base refuses", "no motion that is steered on the move is recorded", "", 0.0)

    def claim(self) -> MotionReport | BodyFault:
        """Nothing more is known."""
        return self.execute(MotorCommand(0.0, 0.0))

    def look(self, purpose: str) -> Frame | BodyFault:
        """The video's next picture."""
        try:
            return self._camera.look(purpose)
        except CameraFault as fault:
            return BodyFault("camera", fault.kind, fault.detail, "", 0.0)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """None is recorded."""
        return BodyFault("elevator", "no ride", "none is recorded", "", 0.0)

    def wait(self, duration_s: float) -> float:
        """Nothing changes by waiting."""
        return duration_s

    def stop(self) -> None:
        """It stands."""


def run(quick: bool, seed: int) -> Report:
    """One mission, and once more from each kind of video."""
    stage = _stage(quick)
    with tempfile.TemporaryDirectory() as folder:
        recorded, kept = _driven(stage, seed)
        rows: list[tuple[Cell, ...]] = [
            ("none: the simulator's camera", None, len(kept.frames), len(recorded.verdicts), None, None, None,
             recorded.outcome)
        ]
        claims: list[tuple[str, bool]] = []
        for name, path, bound_m, bound_rad in _videos(Path(folder), [f.jpeg for f in kept.frames]):
            again = _repeated(stage, seed, kept, path)
            same = _same(recorded.verdicts, again.verdicts)
            apart_m, turned_rad = _apart(recorded.poses, again.poses)
            rows.append((name, path.stat().st_size / 1e6, len(kept.frames), len(again.verdicts),
                         f"{same} of {len(recorded.verdicts)}", 1000.0 * apart_m, math.degrees(turned_rad),
                         again.outcome))
            claims += [
                (f"{name}: the same milestones with the same verdicts, in the same order",
                 recorded.verdicts == again.verdicts and recorded.outcome == again.outcome),
                (f"{name}: poses within {1000.0 * bound_m:g} mm and {math.degrees(bound_rad):.2g} degrees",
                 apart_m <= bound_m and turned_rad <= bound_rad),
            ]
    return Report(
        "A mission's camera stream through a video file and OpenCV's VideoCapture", COLUMNS, tuple(rows),
        notes=(
            f"Mission: {stage.scenario.name}, seed {seed}, goal {stage.scenario.goal}. The body repeats the recorded "
            "motion reports, so the robot is truly where the pictures were taken.",
            "camera.mjpeg: the camera's JPEGs one behind the other, as a run directory keeps them; VideoCapture hands "
            "them over untouched (CAP_PROP_FORMAT -1): nothing is lost but the times.",
            "FFV1: the decoded pixels are kept to the bit, but VideoCamera has to compress them once more (JPEG "
            "quality 95). MJPG: OpenCV compresses them once more as it writes.",
            "Poses: the greatest distance between pose fixes of the same number.",
        ),
        claims=tuple(claims),
    )


def _stage(quick: bool) -> Stage:
    scenario = load_scenario(QUICK_SCENARIO if quick else SCENARIO)
    return build_stage(with_settings(scenario, {"goal": QUICK_GOAL}) if quick else scenario)


def _driven(stage: Stage, seed: int) -> tuple[Told, Recording]:
    told, kept = Told(), list[Recording]()

    def around(body: Body, _retelling: Callable[[], bool]) -> Body:
        kept.append(Recording(body))
        return kept[-1]

    run_mission(stage, seed, sinks=(told,), around=around)
    return told, kept[0]


def _repeated(stage: Stage, seed: int, kept: Recording, video: Path) -> Told:
    told, camera = Told(), stage.scenario.camera.camera
    with VideoCamera(str(video), (camera.width, camera.height), clock=lambda: 0.0) as eye:
        body = Repeating(kept.motions, eye)
        run_mission(stage, seed, sinks=(told,), around=lambda _body, _retelling: body)
    return told


def _videos(folder: Path, jpegs: list[bytes]) -> Iterator[tuple[str, Path, float, float]]:
    """Name, file, and by how much poses may differ [m, rad]."""
    raw = folder / "camera.mjpeg"
    raw.write_bytes(b"".join(jpegs))
    yield "camera.mjpeg", raw, LOSSLESS_M, LOSSLESS_M
    for codec in ("FFV1", "MJPG"):
        write_video(folder / f"{codec}.avi", jpegs, codec=codec)
        yield f"AVI, {codec}", folder / f"{codec}.avi", LOSSY_M, LOSSY_RAD


def _same(first: list[str], second: list[str]) -> int:
    return sum(a == b for a, b in zip(first, second, strict=False))


def _apart(first: list[Pose2], second: list[Pose2]) -> tuple[float, float]:
    """The greatest distance [m] and turn [rad]; infinite where there are not as many."""
    if len(first) != len(second):
        return math.inf, math.inf
    pairs = list(zip(first, second, strict=True))
    return (max((a.distance_to(b) for a, b in pairs), default=0.0),
            max((abs(wrap_angle(a.heading_rad - b.heading_rad)) for a, b in pairs), default=0.0))
