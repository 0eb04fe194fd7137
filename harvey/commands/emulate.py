"""``harvey emulate``: a base on a pseudo-terminal, for trying things out without one."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand, whole
from harvey.errors import BadInput

if TYPE_CHECKING:
    from sim.body.simulated_body import SimulatedBody
    from sim.emulators.camera_server import CameraServer
    from sim.emulators.emulator import IdealGround
    from sim.scenario import CameraSettings

MAX_PORT = 65535
TELL_S = 1.0
"""How often its place is printed, with --trace [s of the base]."""


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("kind", metavar="KIND", help="which protocol it speaks: denning; with harvey-bases p2os or"
                        " create2; with harvey-ros2 ros2; or one that another installed package brings")
    parser.add_argument("--scenario", metavar="NAME",
                        help="put it where a scenario begins, with the scenario's walls, wheels and faults; else on an"
                             " endless floor")
    parser.add_argument("--seed", metavar="N", type=whole, default=0, help="of the scenario's chance (0)")
    parser.add_argument("--camera-port", metavar="PORT", type=_port,
                        help="serve what the robot's camera sees as motion JPEG on this port of 127.0.0.1; 0 takes a"
                             " free one")
    parser.add_argument("--calibration", metavar="FILE", help="write what harvey calibrate would find of that camera")
    parser.add_argument("--speed", metavar="X", type=_factor, default=1.0,
                        help="run X times as fast as real time, watchdog and all (1)")
    parser.add_argument("--at", metavar="ADDRESS", help="with ros2: where its Zenoh router listens, as"
                        " tcp/127.0.0.1:7447, or the robot's file of who drives it; else on any free port")
    parser.add_argument("--trace", action="store_true", help="print the traffic, and where the robot is")


def _port(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) <= MAX_PORT):
        raise ArgumentTypeError(f"expected a port from 0 to {MAX_PORT}, got {text!r}")
    return int(text)


def _factor(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 1000.0:
        raise ArgumentTypeError(f"expected a factor of 0.01 to 1000, got {text!r}")
    return value


def _run(args: Namespace) -> int:
    from harvey.hardware.bases import say_what_to_install
    from harvey.simulation.serial_body import emulator_kinds
    from sim.emulators.emulator import IdealGround, Served
    from sim.emulators.line import FaultyLine, PseudoTerminal

    kind = emulator_kinds().get(args.kind)
    if kind is None:
        raise BadInput(f"expected a kind of base, one of {', '.join(emulator_kinds())}, got {args.kind!r}"
                       f"{say_what_to_install(args.kind)}")
    if args.scenario is None and not (args.camera_port is None and args.calibration is None):
        raise BadInput("--camera-port and --calibration: expected a --scenario to look at, got none")
    if kind.serve is not None and args.camera_port is not None:
        raise BadInput(f"--camera-port: expected none with {args.kind}, which brings its camera along")
    if kind.serve is None and args.at is not None:
        raise BadInput(f"--at: expected none with {args.kind}, which is on a serial port")
    body, sight = (None, None) if args.scenario is None else _body(args.scenario, args.seed, args.calibration)
    ground = IdealGround() if body is None else body
    trace = _Trace(args.kind == "denning" or kind.serve is not None, ground) if args.trace else None
    until = trace.tell_place if trace else lambda: False
    if kind.serve is not None:
        kind.serve(Served(ground, body, args.at or "", args.speed, until, trace=trace,
                          camera=None if sight is None else sight.camera,
                          mount=None if sight is None else sight.mount))
        return 0
    emulator = kind.on_ground(ground) if body is None else FaultyLine(kind.on_ground(ground), body)
    with _camera(args.camera_port, body) as camera, closing(PseudoTerminal(emulator, trace)) as terminal:
        print(f"an emulated {args.kind} base is at {terminal.name}; Ctrl-C ends it", flush=True)
        if camera is not None:
            print(f"its camera is at {camera.url}", flush=True)
        try:
            terminal.serve(args.speed, until=until)
        except KeyboardInterrupt:
            print("the base is gone", file=sys.stderr)
    return 0


@contextmanager
def _camera(port: int | None, body: SimulatedBody | None) -> Iterator[CameraServer | None]:
    """The robot's camera on the network, if it is wanted. Raises BadInput where the port is in use."""
    if port is None or body is None:
        yield None
        return
    from sim.emulators.camera_server import CameraServer

    body.picture()  # the renderer is compiled before anybody waits for a picture
    try:
        server = CameraServer(body, port)
    except OSError as error:
        raise BadInput(f"--camera-port {port}: expected a free port, got: {error.strerror}") from None
    with server as camera:
        yield camera


def _body(name: str, seed: int, calibration: str | None) -> tuple[SimulatedBody, CameraSettings]:
    """The simulated body where a scenario begins, and its camera; writes what a calibration would find of it."""
    from sim.scenario import ScenarioError, load_scenario
    from sim.stage import build_stage
    from world_models.files.toml.camera_file import camera_text

    print(f"{name}: setting the stage", file=sys.stderr, flush=True)
    try:
        scenario = load_scenario(name)
        body = build_stage(scenario).body(seed)
    except ScenarioError as error:
        raise BadInput(str(error)) from None
    if calibration is not None:
        text = camera_text(scenario.camera.camera, scenario.camera.mount, (f"the simulated camera of {name}",))
        Path(calibration).write_text(text, encoding="utf-8")
    return body, scenario.camera


class _Trace:
    """Prints the traffic: lines of text as they are, bytes in hexadecimal; and now and then where the robot is."""

    def __init__(self, is_text: bool, ground: IdealGround | SimulatedBody) -> None:
        self._text, self._ground = is_text, ground
        self._printed_s, self._place = 0.0, ""

    def __call__(self, direction: str, data: bytes) -> None:
        lines = data.decode("ascii", "backslashreplace").splitlines() if self._text else [data.hex(" ")]
        for line in lines:
            print(f"{self._ground.time_s:9.3f} {direction} {line}", flush=True)

    def tell_place(self) -> bool:
        """Where it is, if that has changed; never the end."""
        now_s = self._ground.time_s
        if now_s - self._printed_s >= TELL_S and (place := self._describe_place()) != self._place:
            self._printed_s, self._place = now_s, place
            print(f"{now_s:9.3f} = {place}", flush=True)
        return False

    def _describe_place(self) -> str:
        from sim.emulators.emulator import IdealGround

        if isinstance(there := self._ground, IdealGround):
            return f"{there.pose.x_m:.3f} {there.pose.y_m:.3f} m"
        truth = there.truth
        hits = f", {truth.collisions} collisions" if truth.collisions else ""
        at = truth.world_from_robot
        return f"{at.x_m:.3f} {at.y_m:.3f} m in {truth.locale or 'no room'}{hits}"


EMULATE = CliCommand(
    "emulate", "a robot base on a pseudo-terminal, for trying things out without one",
    (
        ("harvey emulate denning", "the documented line protocol; docs/protocol-denning.md"),
        ("harvey emulate create2 --trace", "a Create 2, with every byte printed"),
        ("harvey emulate p2os --scenario lab-to-allens-office", "a Pioneer in the robot laboratory, walls and all"),
        ("harvey emulate ros2 --scenario lab-to-allens-office --calibration camera.toml",
         "a robot that speaks ROS 2 over Zenoh, with its camera; docs/how-to/ros2.md"),
        ("harvey emulate create2 --scenario link-lost --camera-port 8090 --calibration camera.toml",
         "with its camera, for harvey drive; docs/hardware.md"),
    ),
    _arguments, _run,
    "It prints the name of a serial port, as /dev/pts/7, and serves it until Ctrl-C. A driver that opens this port\n"
    "finds a base that answers byte by byte as the real one would. In another terminal, for one metre ahead:\n"
    "  python -c \"from harvey.hardware.bases import open_base; print(open_base('denning:/dev/pts/7').move(1))\"",
)
