"""Preflight: before the first move, everything that a mission on hardware needs is checked. Nothing moves."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from harvey.dry_run import MilestonePreview, Otherwise, dry_run, not_otherwise, summarize_dry_run
from harvey.errors import BadInput
from harvey.hardware.bases import kind_of, open_base
from harvey.hardware.drivers.base_driver import Base, BaseFault
from harvey.hardware.drivers.capture import CameraFault
from harvey.hardware.drivers.video_camera import VideoCamera
from harvey.hardware.hardware_mission import HardwareMission
from knowledge_sources.methods.features import MIN_CONTRAST, read_picture
from knowledge_sources.settings import DEFAULT, Settings
from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.camera import Camera, CameraDeviation, CameraMount
from world_models.commands import parse_command
from world_models.files.toml.camera_file import load_camera
from world_models.files.toml.source import WorldError
from world_models.files.world_files import load_world
from world_models.robot import RobotModel
from world_models.words import count

MIN_FREE_BYTES = 500_000_000
"""Free space that a long run's pictures may need."""
BEATS = 5
MIN_PICTURES = 8
MAX_CREEP_M, MAX_CREEP_RAD = 0.005, 0.01
"""Wheels that count more than this while they should stand are moving."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was checked.

    Attributes:
        what: in a word or two.
        found: the finding.
        todo: what to do where it failed; "" where it did not.
    """

    what: str
    found: str
    todo: str = ""

    @property
    def ok(self) -> bool:
        return not self.todo


class Preflight:
    """The robot as far as it could be built, and the finding of each check; closes what it opened.

    Attributes:
        checks: in the order in which they were made.
        robot, base, camera: None where a check before them failed.
        previews: the milestones to come.
    """

    def __init__(
        self, mission: HardwareMission, out: Path, clock: Callable[[], float], settings: Settings = DEFAULT,
        what_if: Otherwise = not_otherwise,
    ) -> None:
        self._mission, self._out, self._clock = mission, out, clock
        self._settings, self._what_if = settings, what_if
        self._open = ExitStack()
        self.checks: list[Check] = []
        self.robot: RobotModel | None = None
        self.base: Base | None = None
        self.camera: VideoCamera | None = None
        self.previews: tuple[MilestonePreview, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether nothing failed."""
        return all(check.ok for check in self.checks)

    def __enter__(self) -> Preflight:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self._open.close()

    def run(self) -> Iterator[Check]:
        """Each check as it is made."""
        for check in self._steps():
            self.checks.append(check)
            yield check

    def _steps(self) -> Iterator[Check]:
        world, checked = self._world()
        yield checked
        seen, checked = self._calibration()
        yield checked
        if world is not None and seen is not None:
            m = self._mission
            camera, mount, deviation = seen
            self.robot = RobotModel(world, camera, mount, m.actuator, m.base.radius_m, deviation=deviation)
            yield from self._plan(world, self.robot)
        if self._mission.motion.continuous:
            yield Check("motion", "these bases cannot be steered on the move", "motion.continuous = false")
        yield from self._base()
        yield from self._camera(None if seen is None else seen[0])
        yield self._room()

    def _world(self) -> tuple[World | None, Check]:
        try:
            world = load_world(self._mission.world)
        except WorldError as error:
            return None, Check("world", str(error), "correct the world file: harvey world check FILE")
        faults = check_world(world)
        if faults:
            found = f"{faults[0]}" + (f" (and {len(faults) - 1} more)" if len(faults) > 1 else "")
            return world, Check("world", found, f"harvey world check {self._mission.world}")
        return world, Check("world", f"{world.name}: {count(len(world.rooms), 'room')}, "
                                     f"{count(len(world.landmarks), 'landmark')}, no faults")

    def _calibration(self) -> tuple[tuple[Camera, CameraMount, CameraDeviation] | None, Check]:
        if not self._mission.camera.calibration:
            return None, Check("calibration", "no file is named", "harvey calibrate, then [camera] calibration = FILE")
        try:
            camera, mount, deviation = load_camera(self._mission.calibration)
        except WorldError as error:
            return None, Check("calibration", str(error), "harvey calibrate --help")
        if mount is None:
            return None, Check("calibration", "it does not say how the camera is mounted",
                               "add [mount] height_m, forward_m, tilt_deg to the file, or calibrate with the board on "
                               "the floor")
        bent = "no distortion" if camera.distortion is None else "with distortion"
        return (camera, mount, deviation), Check(
            "calibration", f"{camera.width} x {camera.height} px, f {camera.fx:.0f} px, {bent}; "
                           f"{mount.height_m:.2f} m above the floor")

    def _plan(self, world: World, robot: RobotModel) -> Iterator[Check]:
        try:
            origin, destination = parse_command(self._mission.goal, world)
        except ValueError as error:
            yield Check("goal", str(error), "name one room for each end: harvey world show")
            return
        for fault in filter(None, (telling.find_fault(world) for telling in self._mission.told)):
            yield Check("told", fault, "name a door, a thing or a room of the world: harvey world show")
        lost = [p for p in (origin, destination) if world.locale_at(p.in_world(world).position) is None]
        if lost:
            todo = "feet, in the locale's own frame: harvey world show"
            yield Check("goal", f"{lost[0]} is not within its locale", todo)
            return
        yield Check("goal", f"from {origin} to {destination}")
        self.previews, outcome = dry_run(world, robot, self._mission.command, self._settings, self._what_if)
        if outcome.kind != "reached":
            yield Check("plan", outcome.reason, "another start or goal, or a world with a way between them")
            return
        said, can_be = summarize_dry_run(self.previews, outcome)
        said = f"{count(len(self.previews), 'milestone')}, {said}"
        yield Check("plan", said, "" if can_be else "put into the world what hangs on the walls there")

    def _base(self) -> Iterator[Check]:
        try:
            kind, _ = kind_of(self._mission.base.port)
            base = self.base = open_base(self._mission.base.port)
        except BadInput as error:
            yield Check("base", str(error).removeprefix("base: "), "plug it in, and name its port: --base")
            return
        self._open.callback(base.close)
        try:
            base.stop()
            before = base.odometry()
            began = time.monotonic()
            for _ in range(BEATS):
                base.heartbeat()
            beat_s = (time.monotonic() - began) / BEATS
            after = base.odometry()
        except BaseFault as fault:
            yield Check("base", str(fault), "is it switched on, is it this kind of base, is the cable crossed?")
            return
        yield Check("base", f"answers in {beat_s * 1000.0:.0f} ms")
        crept_m = max(abs(after.x_m - before.x_m), abs(after.y_m - before.y_m))
        crept_rad = abs(after.heading_rad - before.heading_rad)
        yield (Check("standing", "its wheels stand") if crept_m < MAX_CREEP_M and crept_rad < MAX_CREEP_RAD else
               Check("standing", f"its wheels count {crept_m * 1000.0:.0f} mm while it should stand", "hold it still"))
        yield Check("watchdog", kind.watchdog)

    def _camera(self, calibrated: Camera | None) -> Iterator[Check]:
        eye = self._mission.camera
        size = None if calibrated is None else (calibrated.width, calibrated.height)
        if not eye.source:
            yield Check("camera", "none is named", "--camera 0, a file or a URL")
            return
        try:
            camera = self.camera = VideoCamera(
                eye.source, size, clock=self._clock, late_s=eye.late_s, lag_s=eye.lag_s)
            self._open.callback(camera.close)
            pictures = [camera.look("dry run") for _ in range(MIN_PICTURES)]
        except CameraFault as fault:
            yield Check("camera", str(fault).removeprefix("the camera: "), _camera_todo(fault))
            return
        rate_hz = camera.health.rate_hz
        took = "" if rate_hz is None else f", {rate_hz:.1f} pictures a second, {camera.health.dropped} dropped"
        slow = rate_hz is not None and rate_hz < eye.rate_hz
        yield Check("camera", f"{len(pictures)} whole pictures{took}",
                    f"[camera] rate_hz = {eye.rate_hz:g} is needed: less light needs longer exposure; try MJPG, a "
                    "shorter cable, fewer devices on the bus" if slow else "")
        contrast = float(read_picture(pictures[-1].jpeg).grey.std())
        is_enough = contrast >= MIN_CONTRAST
        yield Check("sight", f"contrast {contrast:.0f} of 255",
                    "" if is_enough else "too dark, or the lens is covered: nothing can be recognized")

    def _room(self) -> Check:
        there = next(p for p in (self._out.resolve(), *self._out.resolve().parents) if p.exists())
        free = shutil.disk_usage(there).free
        return Check("disk", f"{free / 1e9:.1f} GB free for {self._out}",
                     "" if free >= MIN_FREE_BYTES else f"make room: {MIN_FREE_BYTES / 1e9:.1f} GB, or another --out")


def _camera_todo(fault: CameraFault) -> str:
    return {
        "unplugged": "plug it in; which number it has: ls /dev/video*",
        "wrong size": "calibrate at the size that the camera delivers",
        "dark": "switch the light on, take the cap off",
    }.get(fault.kind, "a faster camera, less on the bus, or a larger [camera] late_s")
