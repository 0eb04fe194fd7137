"""A base and a camera put together: what goes wrong is a value, a stop key stops, and claims are what wheels count."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from harvey.hardware.drivers.base_driver import BaseFault, FaultKind
from harvey.hardware.drivers.capture import CameraFault, CameraFaultKind
from harvey.hardware.drivers.video_camera import Health, VideoCamera
from harvey.hardware.hardware_body import BASE_WORDS, CAMERA_WORDS, HardwareBody, WatchedCamera
from harvey.hardware.hardware_mission import load_mission
from harvey.hardware.stopping import Heartbeat
from world_models.entries import STOP_KEY, BodyFault, CameraPicture, MotionReport, MotorCommand, Odometry, Ranges
from world_models.files.toml.mission import ROOT


class Clock:
    """Time that is told."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def pass_(self, duration_s: float) -> None:
        self.now_s += duration_s


class FakeBase:
    """Goes straight ahead; fails when told to.

    Attributes:
        fails: how the next call that moves fails, after so much of it.
        x_m: where it counts that it is.
        calls: what was called.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.fails: tuple[FaultKind, float] | None = None
        self.dead = False
        self.x_m = 5.0
        self.calls: list[str] = []

    def turn(self, turn_rad: float) -> MotionReport:
        return self.execute(MotorCommand(turn_rad, 0.0))

    def move(self, move_m: float) -> MotionReport:
        return self.execute(MotorCommand(0.0, move_m))

    def take_contact(self) -> None:
        return None

    def ranges(self) -> Ranges | None:
        return None

    def execute(self, command: MotorCommand, /) -> MotionReport:
        self._called("execute")
        part = 1.0 if self.fails is None else self.fails[1]
        self._clock.pass_(command.move_m / 0.4)
        self.x_m += part * command.move_m
        report = MotionReport(command.turn_rad, part * command.move_m, 1.0, -1.0)
        if self.fails is not None:
            kind, self.fails = self.fails[0], None
            raise BaseFault(kind, "as it was told to", done=report)
        return report

    def stop(self) -> None:
        self._called("stop")

    def odometry(self) -> Odometry:
        self._called("odometry")
        return Odometry(self.x_m, 0.0, 0.0, 0.0)

    def heartbeat(self) -> None:
        self._called("heartbeat")

    def close(self) -> None:
        self.calls.append("close")

    def _called(self, what: str) -> None:
        self.calls.append(what)
        if self.dead:
            raise BaseFault("disconnected", "no such device")


class Open:
    """An eye that is open."""

    def look(self, purpose: str) -> CameraPicture | BodyFault:
        return CameraPicture(b"", 0, 0.0, purpose)


def robot(clock: Clock | None = None) -> tuple[HardwareBody, FakeBase, Clock]:
    clock = clock or Clock()
    base = FakeBase(clock)
    return HardwareBody(base, Open(), clock=clock, pause=clock.pass_), base, clock


def test_a_report_is_dated_by_the_missions_clock_and_the_link_is_tried_before_the_wheels_turn() -> None:
    body, base, clock = robot()
    report = body.execute(MotorCommand(0.0, 0.4))
    assert report == MotionReport(0.0, 0.4, 1.0, clock.now_s)
    assert base.calls == ["odometry", "execute"]


@pytest.mark.parametrize("kind", BASE_WORDS)
def test_every_fault_of_a_base_is_a_value_that_says_what_was_done(kind: FaultKind) -> None:
    body, base, clock = robot()
    base.fails = (kind, 0.5)
    fault = body.execute(MotorCommand(0.0, 0.4))
    assert isinstance(fault, BodyFault) and fault.is_open
    assert (fault.part, fault.what, fault.move_m, fault.when_s) == ("base", BASE_WORDS[kind], 0.2, clock.now_s)


def test_after_a_fault_the_claim_is_what_the_wheels_count_and_the_base_is_told_to_stand_first() -> None:
    body, base, _ = robot()
    base.fails = ("silent", 0.5)
    body.execute(MotorCommand(0.0, 0.4))
    base.x_m += 0.05  # it rolled on until its watchdog struck
    base.calls.clear()
    claim = body.claim()
    assert isinstance(claim, MotionReport) and claim.move_m == pytest.approx(0.25)
    assert base.calls == ["stop", "odometry"]


def test_a_base_that_lost_count_claims_what_was_last_heard_of_it() -> None:
    body, base, _ = robot()
    base.fails = ("disconnected", 0.25)
    body.execute(MotorCommand(0.0, 0.4))
    base.x_m = 0.0  # switched off and on again
    claim = body.claim()
    assert isinstance(claim, MotionReport) and claim.move_m == pytest.approx(0.1)


def test_a_line_that_is_dead_before_the_move_moves_nothing() -> None:
    body, base, _ = robot()
    base.dead = True
    assert isinstance(body.execute(MotorCommand(0.0, 0.4)), BodyFault)
    assert isinstance(body.claim(), BodyFault)
    assert "execute" not in base.calls
    base.dead = False
    assert body.claim() == MotionReport(0.0, 0.0, 0.0, 0.0)


def test_once_stopped_for_good_nothing_moves_and_everything_says_so() -> None:
    body, base, _ = robot()
    stopper = threading.Thread(target=body.stop_for_good, args=("stopped by the q key",))
    stopper.start()
    while "stop" not in base.calls:
        pass
    answers: list[object] = [body.execute(MotorCommand(0.0, 0.4)), body.look("track"), body.claim()]
    stopper.join()
    assert all(isinstance(a, BodyFault) and (a.part, a.what) == ("user", STOP_KEY) for a in answers)
    assert all(isinstance(a, BodyFault) and a.detail == "stopped by the q key" for a in answers)
    assert "execute" not in base.calls


class FakeCamera(VideoCamera):
    """Delivers as it is told to."""

    def __init__(self) -> None:
        self.rate_hz: float | None = None
        self.fails: CameraFaultKind | None = None

    @property
    def health(self) -> Health:
        return Health(1, 0, self.rate_hz, 0.0, "")

    def look(self, purpose: str = "") -> CameraPicture:
        if self.fails is not None:
            raise CameraFault(self.fails, "as it was told to")
        return CameraPicture(b"", 0, 0.0, purpose)


@pytest.mark.parametrize("kind", CAMERA_WORDS)
def test_every_fault_of_a_camera_is_a_value(kind: CameraFaultKind) -> None:
    camera = FakeCamera()
    camera.fails = kind
    fault = WatchedCamera(camera, Clock()).look("track")
    assert isinstance(fault, BodyFault) and (fault.part, fault.what) == ("camera", CAMERA_WORDS[kind])


def test_too_few_pictures_a_second_are_told_whenever_that_begins_and_looks_go_on() -> None:
    camera = FakeCamera()
    eye = WatchedCamera(camera, Clock(), rate_hz=5.0)

    def told(rate_hz: float | None) -> bool:
        camera.rate_hz = rate_hz
        seen = eye.look("track")
        return isinstance(seen, BodyFault) and seen.what == "frame rate low"

    assert [told(rate) for rate in (None, 30.0, 2.0, 2.0, 1.0, 30.0, 4.9)] == [
        False, False, True, False, False, False, True]


class Counted(FakeBase):
    """Tells when it was called."""

    def __init__(self, clock: Clock, called: Callable[[str], None]) -> None:
        super().__init__(clock)
        self._tell = called

    def _called(self, what: str) -> None:
        super()._called(what)
        self._tell(what)


def test_the_heart_beats_while_the_mission_goes_on_and_stops_the_base_once_it_hangs() -> None:
    clock, beaten, stopped = Clock(), threading.Event(), threading.Event()
    base = Counted(clock, lambda what: beaten.set() if what == "heartbeat" else stopped.set())
    with Heartbeat(base, beat_s=0.001, max_silence_s=5.0, clock=clock) as heart:
        assert beaten.wait(10.0) and heart.beating and not stopped.is_set()
        clock.pass_(6.0)
        assert stopped.wait(10.0) and not heart.beating
        beaten.clear()
        heart.tick()
        assert beaten.wait(10.0)


class Sonars(FakeBase):
    """A base with one sonar, which fails when it is told to."""

    def ranges(self) -> Ranges | None:
        self._called("ranges")
        if self.fails is not None:
            raise BaseFault(self.fails[0], "as it was told to")
        return Ranges((0.0,), (1.0,), 0.01, 0.2, 5.0, -1.0)


def test_ranges_are_asked_for_only_where_the_mission_wants_them_and_dated_by_our_clock() -> None:
    clock = Clock()
    base = Sonars(clock)
    clock.pass_(3.0)
    assert HardwareBody(base, Open(), clock=clock).ranges() is None and "ranges" not in base.calls
    body = HardwareBody(base, Open(), clock=clock, ranges=True)
    found = body.ranges()
    assert found is not None and (found.when_s, found.distances_m) == (3.0, (1.0,))
    base.fails = ("silent", 0.0)
    assert body.ranges() is None


def test_a_missions_file_says_whether_ranges_are_read(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "flat" / "mission.toml").read_text(encoding="utf-8")
    for more, wanted in (("", False), ("\n[ranges]\nread = true\n", True)):
        (tmp_path / "m.toml").write_text(text + more, encoding="utf-8")
        assert load_mission(tmp_path / "m.toml", {}).ranges.read is wanted
