"""A mission's camera stream read back through OpenCV's VideoCapture: are the milestones the same?

A mission is driven in the simulator and its frames are written to video files. Then the same mission is driven by a
body that repeats the recorded motions and takes its frames from the video with :class:`VideoCamera`.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from blackboard.journal import Decision
from experiments.report import Cell, Report
from experiments.wrappers import WrappedBody
from harvey.hardware.drivers.camera import VideoCamera
from harvey.hardware.drivers.capture import CameraFault
from harvey.hardware.drivers.video_file import write_video
from harvey.runner.ports import Body
from harvey.simulation.run import run_mission
from sim.scenario import load_scenario, with_settings
from sim.stage import Stage, build_stage
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Ride, RideReport
from world_models.entries.obstacle import Contact, Ranges
from world_models.entries.percepts import PoseFix
from world_models.entries.task import Certificate, Outcome
from world_models.frames import Pose2, wrap_angle

SCENARIO = "lab-to-allens-office"
QUICK_SCENARIO, QUICK_GOAL = "forty-foot-hallway", "(ptrans (hallway (4,4,0)) (hallway (14,4,0)))"
MAX_LOSSLESS_M, MAX_LOSSY_M, MAX_LOSSY_RAD = 1e-9, 0.01, math.radians(0.5)
COLUMNS = ("video", "MB", "looks", "milestones", "same verdicts", "max pose difference mm", "degrees", "outcome")


@dataclass(eq=False)
class MissionLog:
    """Verdicts and pose fixes of a mission in their order, and its outcome."""

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


class RecordedBody(WrappedBody):
    """A body whose motions and frames are kept."""

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.motions: list[MotionReport | BodyFault] = []
        self.frames: list[Frame] = []

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        self.motions.append(super().execute(command))
        return self.motions[-1]

    def look(self, purpose: str) -> Frame | BodyFault:
        answer = super().look(purpose)
        if isinstance(answer, Frame):
            self.frames.append(answer)
        return answer


class RepeatingBody:
    """A body that answers commands with recorded motions, in their order, and looks with a camera."""

    def __init__(self, motions: list[MotionReport | BodyFault], camera: VideoCamera) -> None:
        self._motions: Iterator[MotionReport | BodyFault] = iter(motions)
        self._camera = camera

    def execute(self, command: MotorCommand) -> MotionReport | BodyFault:
        """Return the next recorded motion, whatever is asked for."""
        return next(self._motions, None) or BodyFault("base", "link lost", "the recorded motions end here", "", 0.0)

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        """Fail: no such motion is recorded."""
        return BodyFault("base", "base refuses", "no motion that is steered on the move is recorded", "", 0.0)

    def claim(self) -> MotionReport | BodyFault:
        """Return the next recorded motion."""
        return self.execute(MotorCommand(0.0, 0.0))

    def take_contact(self) -> Contact | None:
        """Return none: none is recorded."""
        return None

    def ranges(self) -> Ranges | None:
        """Return none: none are recorded."""
        return None

    def look(self, purpose: str) -> Frame | BodyFault:
        """Return the video's next frame."""
        try:
            return self._camera.look(purpose)
        except CameraFault as fault:
            return BodyFault("camera", fault.kind, fault.detail, "", 0.0)

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """Fail: no ride is recorded."""
        return BodyFault("elevator", "no ride", "none is recorded", "", 0.0)

    def wait(self, duration_s: float) -> float:
        """Return at once."""
        return duration_s

    def stop(self) -> None:
        """Do nothing: it stands."""


def run(quick: bool, seed: int) -> Report:
    """Drive one mission, and again from each kind of video."""
    stage = _stage(quick)
    with tempfile.TemporaryDirectory() as folder:
        recorded, body = _drive(stage, seed)
        rows: list[tuple[Cell, ...]] = [
            ("none: simulated camera", None, len(body.frames), len(recorded.verdicts), None, None, None,
             recorded.outcome)
        ]
        claims: list[tuple[str, bool]] = []
        for name, path, bound_m, bound_rad in _videos(Path(folder), [f.jpeg for f in body.frames]):
            again = _drive_from_video(stage, seed, body, path)
            same = _count_same(recorded.verdicts, again.verdicts)
            apart_m, turned_rad = _max_difference(recorded.poses, again.poses)
            rows.append((name, path.stat().st_size / 1e6, len(body.frames), len(again.verdicts),
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
            "motion reports, so the robot's true poses are those of the frames.",
            "camera.mjpeg: the camera's JPEGs one after the other, as in a run directory; VideoCapture returns them "
            "unchanged (CAP_PROP_FORMAT -1): nothing is lost but the times.",
            "FFV1: lossless in the decoded pixels, but VideoCamera compresses them again (JPEG quality 95). MJPG: "
            "OpenCV compresses them again as it writes.",
            "Poses: the largest difference between pose fixes of the same number.",
        ),
        claims=tuple(claims),
    )


def _stage(quick: bool) -> Stage:
    scenario = load_scenario(QUICK_SCENARIO if quick else SCENARIO)
    return build_stage(with_settings(scenario, {"goal": QUICK_GOAL}) if quick else scenario)


def _drive(stage: Stage, seed: int) -> tuple[MissionLog, RecordedBody]:
    log, bodies = MissionLog(), list[RecordedBody]()

    def around(body: Body, _retelling: Callable[[], bool]) -> Body:
        bodies.append(RecordedBody(body))
        return bodies[-1]

    run_mission(stage, seed, sinks=(log,), around=around)
    return log, bodies[0]


def _drive_from_video(stage: Stage, seed: int, recorded: RecordedBody, video: Path) -> MissionLog:
    log, camera = MissionLog(), stage.scenario.camera.camera
    with VideoCamera(str(video), (camera.width, camera.height), clock=lambda: 0.0) as video_camera:
        body = RepeatingBody(recorded.motions, video_camera)
        run_mission(stage, seed, sinks=(log,), around=lambda _body, _retelling: body)
    return log


def _videos(folder: Path, jpegs: list[bytes]) -> Iterator[tuple[str, Path, float, float]]:
    """Yield name, file, and the largest allowed difference of poses [m, rad]."""
    raw = folder / "camera.mjpeg"
    raw.write_bytes(b"".join(jpegs))
    yield "camera.mjpeg", raw, MAX_LOSSLESS_M, MAX_LOSSLESS_M
    for codec in ("FFV1", "MJPG"):
        write_video(folder / f"{codec}.avi", jpegs, codec=codec)
        yield f"AVI, {codec}", folder / f"{codec}.avi", MAX_LOSSY_M, MAX_LOSSY_RAD


def _count_same(first: list[str], second: list[str]) -> int:
    return sum(a == b for a, b in zip(first, second, strict=False))


def _max_difference(first: list[Pose2], second: list[Pose2]) -> tuple[float, float]:
    """Largest distance [m] and turn [rad] between poses; infinite if their numbers differ."""
    if len(first) != len(second):
        return math.inf, math.inf
    pairs = list(zip(first, second, strict=True))
    return (max((a.distance_to(b) for a, b in pairs), default=0.0),
            max((abs(wrap_angle(a.heading_rad - b.heading_rad)) for a, b in pairs), default=0.0))
