"""What a user gives to ``harvey drive``: each mistake is one clear line with what to do, and nothing is moved."""

from __future__ import annotations

import errno
import math
import os
import signal
import termios
import threading
from pathlib import Path

import pytest

from harvey.cli import main
from harvey.errors import BadInput
from harvey.hardware import bases as hardware_base
from harvey.hardware.bases import open_base
from harvey.hardware.hardware_mission import load_mission
from harvey.hardware.preflight import Preflight
from harvey.hardware.stopping import stop_key
from harvey.simulation.serial_body import body_kind, emulator_kinds
from sim.emulators.denning_emulator import ConstantSpeedMotion, DenningEmulator
from sim.emulators.emulator import IdealGround
from sim.emulators.line import PseudoTerminal
from world_models import plugins
from world_models.camera import Camera, CameraMount
from world_models.files.toml.camera_file import camera_text

GOAL = "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"


FLAT = Path(__file__).parents[3] / "docs" / "flat"


def test_a_missions_file_is_read_and_options_go_before_it() -> None:
    mission = load_mission(FLAT / "mission.toml", {"base.port": "denning:/dev/ttyS0", "start.heading_deg": "45"})
    assert mission.name == "mission" and mission.world == FLAT / "flat.toml"
    assert mission.base.port == "denning:/dev/ttyS0" and mission.base.radius_m == 0.18
    assert mission.start.heading_rad == pytest.approx(math.pi / 4) and mission.camera.source == "0"
    assert mission.calibration == FLAT / "camera.toml"


@pytest.mark.parametrize(("goal", "told"), [
    ("Go from the hall to the kitchen", "from (hall"),
    ("Bring this from the hall to the cellar", "no room of flat answers to 'the cellar'"),
    ("(ptrans (hall (4,3,0)) (attic (6,5,0)))", "got 'attic'"),
])
def test_a_goal_may_be_said_in_words_and_is_understood_before_anything_moves(
    goal: str, told: str, tmp_path: Path
) -> None:
    (tmp_path / "camera.toml").write_text(camera_text(Camera.from_field_of_view(1.1), CameraMount(0.7)))
    mission = load_mission(FLAT / "mission.toml", {"goal": goal, "camera.calibration": str(tmp_path / "camera.toml")})
    with Preflight(mission, tmp_path / "run", lambda: 0.0) as dry:
        found = next(check for check in dry.run() if check.what == "goal")
    assert told in found.found and found.ok == told.startswith("from")


@pytest.mark.parametrize(("text", "told"), [
    ('goal = "here"\nworld = "flat.toml"', "m.toml:1: goal"),
    (f'goal = "{GOAL}"', "expected the key 'world'"),
    (f'world = "w"\ngoal = "{GOAL}"\n[base]\nport = 3', "m.toml:4: base.port: expected a non-empty text, got 3"),
    (f'world = "w"\ngoal = "{GOAL}"\n[base]\nprot = "x"', "expected one of port"),
    (f'world = "w"\ngoal = "{GOAL}"\n[base]\nradius_m = -1', "expected a radius of 0.02 to 2 m, got -1"),
    (f'world = "w"\ngoal = "{GOAL}"\n[camera]\nrate_hz = 0', "expected 0.1 to 1000 pictures a second"),
    (f'world = "w"\ngoal = "{GOAL}"\n[limits]\nmax_time_s = 0', "limits.max_time_s: expected a number above 0"),
    (f'world = "w"\ngoal = "{GOAL}"\n[start]\nheading_deg = nan', "heading"),
    (f'world = "w"\ngoal = "{GOAL}"\n[actuator]\nreach = 0', "actuator.reach: expected a number from 0.1 to 2"),
    (f'world = "w"\ngoal = "{GOAL}"\n[actuator]\nturn_increment_deg = 400',
     "turn_increment_deg: expected a number from 0.572958 to 180, got 400"),
    ("world = ", "m.toml:1: expected TOML"),
])
def test_a_mission_that_cannot_be_read_is_named_with_its_line(
    tmp_path: Path, text: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.toml").write_text(text)
    assert main(["drive", str(tmp_path / "m.toml")]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(("options", "told"), [
    ([], "expected MISSION.toml, or --world and --goal at least"),
    (["--world", "research_center"], "expected MISSION.toml, or --world and --goal at least"),
    (["nowhere.toml"], "nowhere.toml: expected a readable file"),
    (["--world", "w", "--goal", GOAL, "--set", "base.prot=x"], "--set base.prot: expected one of base.port"),
    (["--world", "w", "--goal", GOAL, "--set", "x"], "--set: expected key=value"),
])
def test_options_that_cannot_be_used_are_named(
    options: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["drive", *options]) == 2
    assert told in capsys.readouterr().err


def test_everything_that_is_not_ready_is_told_at_once_with_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([
        "drive", "--world", str(tmp_path / "flat.toml"), "--goal", GOAL, "--base", "denning:/dev/ttyUSB97",
        "--camera", str(tmp_path / "none.avi"), "--calibration", str(tmp_path / "none.toml"),
        "--out", str(tmp_path / "run"),
    ]) == 2
    told, summary = capsys.readouterr()
    for what in ("world", "calibration", "base", "camera"):
        assert f"FAILED  {what}" in told
    assert "/dev/ttyUSB97: expected a serial port, but there is no such port" in told
    assert "-> plug it in, and name its port: --base" in told
    assert "4 of 5 failed: nothing was moved" in summary
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("continuous", ["on", "off"])
def test_that_a_base_cannot_be_steered_on_the_move_is_found_out_before_anything_moves(
    continuous: str, tmp_path: Path
) -> None:
    mission = load_mission(FLAT / "mission.toml", {"motion.continuous": continuous})
    with Preflight(mission, tmp_path / "run", lambda: 0.0) as dry:
        found = [check for check in dry.run() if check.what == "motion"]
    assert [check.todo for check in found] == ["motion.continuous = false"] * (continuous == "on")


@pytest.mark.parametrize("port", ["", "denning", "denning:", "roomba:/dev/ttyUSB0", "/dev/ttyUSB0"])
def test_a_base_is_named_by_its_protocol_and_its_port(port: str) -> None:
    with pytest.raises(BadInput, match="expected denning:PORT"):
        open_base(port)


@pytest.mark.parametrize("absent", ["p2os", "create2"])
def test_of_an_absent_extra_it_is_told_what_to_install(absent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: ())
    kept = (hardware_base.base_kinds, emulator_kinds)
    for kinds in kept:
        kinds.cache_clear()
    try:
        with pytest.raises(BadInput, match=f"{absent} needs harvey-bases: pip install ./extras/harvey-bases"):
            open_base(f"{absent}:/dev/ttyUSB0")
        with pytest.raises(BadInput, match=f"{absent} needs harvey-bases: pip install ./extras/harvey-bases"):
            body_kind(f"serial:{absent}")
        assert main(["emulate", absent]) == 2
    finally:
        for kinds in kept:
            kinds.cache_clear()


@pytest.mark.parametrize(("number", "told"), [
    (errno.EACCES, "you may not use it: sudo usermod -aG dialout"), (errno.EBUSY, "another program has it"),
])
def test_why_a_port_cannot_be_opened_is_told(monkeypatch: pytest.MonkeyPatch, number: int, told: str) -> None:
    def refuse(url: str, baud: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(hardware_base, "SerialLink", refuse)
    with pytest.raises(BadInput, match=told):
        open_base("denning:/dev/ttyUSB0")


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="expected a serial port, but it is no serial port"):
        open_base(f"denning:{tmp_path / 'file'}")


class Chatterer(DenningEmulator):
    """A base that does not speak the protocol that it is driven by."""

    def take(self) -> bytes:
        return b"\xfa\xfb\x03\x00\x00\x00" if super().take() else b""


def test_a_base_of_another_kind_and_a_wall_for_a_goal_are_found_out_before_anything_moves(tmp_path: Path) -> None:
    emulator = Chatterer(ConstantSpeedMotion(IdealGround()))
    terminal, over = PseudoTerminal(emulator), threading.Event()
    server = threading.Thread(target=terminal.serve, kwargs={"until": over.is_set})
    server.start()
    (tmp_path / "camera.toml").write_text(camera_text(Camera.from_field_of_view(1.1), CameraMount(1.0)))
    mission = load_mission(None, {
        "world": "research_center", "goal": "(ptrans (hallway (4,4,0)) (hallway (400,4,0)))",
        "base.port": f"denning:{terminal.name}", "camera.calibration": str(tmp_path / "camera.toml"),
    })
    try:
        with Preflight(mission, tmp_path / "run", lambda: 0.0) as dry:
            checks = {check.what: check for check in dry.run()}
    finally:
        over.set()
        server.join()
        terminal.close()
    assert checks["world"].ok and checks["calibration"].ok
    assert "is not within its locale" in checks["goal"].found and not checks["goal"].ok
    assert not checks["base"].ok and "is it this kind of base" in checks["base"].todo
    assert emulator.executed == [] and not dry.ok


@pytest.mark.parametrize("text", ["serial", "serial:", "serial:roomba", "denning", ""])
def test_a_body_that_is_none_is_refused_with_those_there_are(text: str) -> None:
    with pytest.raises(BadInput, match="expected one of simulated, serial:denning"):
        body_kind(text)


@pytest.mark.parametrize(("key", "told"), [(b" ", "space"), (b"\n", "enter"), (b"q", "q"), (b"\x1b", "escape")])
def test_a_key_on_the_terminal_stops_and_the_terminal_is_as_before(key: bytes, told: str) -> None:
    ours, theirs = os.openpty()
    said: list[str] = []
    heard = threading.Event()
    attributes = termios.tcgetattr(theirs)
    with stop_key(lambda why: (said.append(why), heard.set()), theirs):
        os.write(ours, b"x" + key)
        assert heard.wait(10.0)
    assert said == [f"stopped by the {told} key"]
    assert termios.tcgetattr(theirs) == attributes
    for end in (ours, theirs):
        os.close(end)


@pytest.mark.parametrize(("number", "told"), [
    (signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM"), (signal.SIGHUP, "SIGHUP"),
])
def test_a_signal_stops_too_and_the_second_one_does_what_it_always_does(number: signal.Signals, told: str) -> None:
    said: list[str] = []
    heard = threading.Event()
    before = signal.getsignal(number)
    with stop_key(lambda why: (said.append(why), heard.set())):
        os.kill(os.getpid(), number)
        assert heard.wait(10.0)
        assert signal.getsignal(number) == before
    assert said == [f"stopped by {told}"] and signal.getsignal(number) == before


def test_an_emulated_camera_needs_something_to_look_at(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["emulate", "denning", "--camera-port", "0"]) == 2
    assert "expected a --scenario to look at, got none" in capsys.readouterr().err
