"""A robot in the hallway for tests of ``harvey drive``: its base on a pseudo-terminal, its camera on the network."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from sim.body.simulated_body import SimulatedBody
from sim.emulators.camera_server import CameraServer
from sim.emulators.denning_emulator import ConstantSpeedMotion, DenningEmulator
from sim.emulators.line import FaultyLine, PseudoTerminal
from sim.faults.fault import Fault
from sim.scenario import Scenario, load_scenario
from sim.stage import build_stage
from world_models.files.toml.camera_file import camera_text

GOAL = "(ptrans (hallway (4,4,0)) (hallway (9,4,0)))"
GOAL_M, INCH_M = 9 * 0.3048, 0.0254
MISSION = f"""
world = "research_center"
goal = "{GOAL}"
[start]
put_down_sigma_in = 0.5
[camera]
calibration = "camera.toml"
lag_s = 0.2
late_s = 5.0
rate_hz = 0.5
"""


@dataclass
class Emulated:
    """What a user is told of an emulated robot, and its truth."""

    body: SimulatedBody
    base: DenningEmulator
    options: list[str]


def scenario() -> Scenario:
    return replace(load_scenario("forty-foot-hallway"), goal=GOAL)


@contextmanager
def emulated(folder: Path, *faults: Fault) -> Iterator[Emulated]:
    """A robot in the hallway, as ``harvey emulate`` has it, in threads of this process."""
    stage = build_stage(replace(scenario(), faults=faults))
    body, over = stage.body(0), threading.Event()
    body.picture()  # compiled before anybody waits for it
    base = DenningEmulator(ConstantSpeedMotion(body), watchdog_s=2.0)
    terminal = PseudoTerminal(FaultyLine(base, body))
    server = threading.Thread(target=terminal.serve, kwargs={"until": over.is_set, "speed": 1.5})
    (folder / "camera.toml").write_text(camera_text(stage.scenario.camera.camera, stage.scenario.camera.mount))
    (folder / "mission.toml").write_text(MISSION)
    with CameraServer(body, rate_hz=6.0) as camera:
        server.start()
        try:
            yield Emulated(body, base, [str(folder / "mission.toml"), "--base", f"denning:{terminal.name}",
                                        "--camera", camera.url, "--out", str(folder / "run")])
        finally:
            over.set()
            server.join()
    terminal.close()
