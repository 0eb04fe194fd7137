"""Scenarios: a mission, the simulated body and building, and the faults, in one TOML file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from sim.body.senses import Bumper, RangeRing
from sim.body.simulated_building import Helper, SimulatedBuilding
from sim.body.wheel_errors import ActuatorParameters
from sim.faults.fault import Fault
from sim.faults.fault_registry import read_fault
from sim.ground_truth.inexact import TrueInexact
from sim.ground_truth.table import NO_DIFFERENCES, TrueCamera, TruthTable
from sim.ground_truth.things import MovedThing
from sim.render.lighting import Lighting
from sim.render.optics import check_lens
from sim.render.rasterizer import sample_offsets
from sim.render.sensor import SensorParameters
from sim.scenario_names import SCENARIOS, find_scenarios
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.files.toml.mission import ROOT, TABLES, Limits, Mission, MissionFormat, named_file
from world_models.files.toml.settings_reader import MAX_NUMBER, read_all, read_settings, suggest_keys
from world_models.files.toml.source import Key, Node, Source, WorldError
from world_models.plugins import list_absent, load_plugins
from world_models.units import Bounded, bounded

MOST_DETAILS = 100
MAX_DISTORTION = 1e4
"""Largest distortion coefficient: those of real lenses are about 1, of long ones some hundreds."""


class ScenarioError(ValueError):
    """A scenario that cannot be read: names the file, the line or key, what was expected and what came."""


@dataclass(frozen=True, slots=True)
class CameraSettings(Bounded):
    """The camera and its mounting.

    Attributes:
        width_px, height_px: of a picture.
        field_of_view_rad: across its width, without distortion.
        mount_height_m: of the optical centre above the floor.
        mount_forward_m: of the optical centre before the robot's axis.
        mount_tilt_rad: of the optical axis, downward.
        distortion: none, or OpenCV's coefficients k1, k2, p1, p2[, k3].
    """

    width_px: int = bounded(512, 16, 4096)
    height_px: int = bounded(512, 16, 4096)
    field_of_view_rad: float = bounded(math.radians(65.0), 0.05, 2.6)
    mount_height_m: float = bounded(1.0, 0.0, 5.0, above=True)
    mount_forward_m: float = bounded(0.1, -2.0, 2.0)
    mount_tilt_rad: float = bounded(0.0, -math.pi / 2.0, math.pi / 2.0)
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        Bounded.__post_init__(self)
        largest = max((abs(k) for k in self.distortion), default=0.0)
        if largest > MAX_DISTORTION:
            raise ValueError(
                f"expected distortion coefficients of at most {MAX_DISTORTION:g} in size, got one of {largest:g}")
        if self.distortion:
            check_lens(self.camera)

    @property
    def camera(self) -> Camera:
        plain = Camera.from_field_of_view(self.field_of_view_rad, self.width_px, self.height_px)
        return replace(plain, distortion=self.distortion) if self.distortion else plain

    @property
    def mount(self) -> CameraMount:
        return CameraMount(self.mount_height_m, self.mount_forward_m, self.mount_tilt_rad)


@dataclass(frozen=True, slots=True)
class Render:
    """Settings of the renderer.

    Attributes:
        samples: per pixel: 1, 4, 8 or 16.
    """

    samples: int = 8

    def __post_init__(self) -> None:
        sample_offsets(self.samples)


@dataclass(frozen=True, slots=True)
class ScenarioLimits(Limits):
    """When to give up, by the truth as well.

    Attributes:
        max_path_m: length of the true path.
        max_collisions: more of them end the run.
    """

    max_path_m: float = bounded(150.0, 0.0, MAX_NUMBER, above=True)
    max_collisions: int = bounded(3, 0, MAX_NUMBER)


@dataclass(frozen=True, slots=True)
class Attendant(Bounded):
    """One of a scenario's ``[[helper]]``: a person in a room, who does what the robot waits for, and says so.

    Attributes:
        room: where this person is; "" for anywhere.
        comes_s: how long the robot has waited when it is done [s].
        says: the word; after a stop the robot needs "go on".
    """

    room: str = ""
    comes_s: float = bounded(4.0, 0.0, 1e6)
    says: str = "done"


@runtime_checkable
class Company(Protocol):
    """A scenario's ``[[walkers]]``: an extra brings what reads them; what is read enters a building, for a run
    with a seed. Both raise ValueError for what does not fit. An act of a knowledge source is charged so long [s]. The
    robot has the guest sources, by name with their package."""

    @property
    def guests(self) -> Mapping[str, str]: ...
    def read(self, node: Node) -> Company: ...
    def enter(self, building: SimulatedBuilding, world: World, seed: int) -> SimulatedBuilding: ...
    def charge(self, who: str) -> float: ...


FORMAT = MissionFormat(
    {**TABLES, "limits": ScenarioLimits, "camera": CameraSettings, "render": Render, "actuator": ActuatorParameters,
     "sensor": SensorParameters, "bumper": Bumper, "ranges": RangeRing},
    ("details", "faults", "helper", "light", "moved", "rides", "truth", "walkers"),
    {"truth.camera": TrueCamera, "truth.inexact": TrueInexact, "light": Lighting},
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario(Mission):
    """One mission in the simulator; the tables of the file are the attributes of the same name.

    Attributes:
        details: files of what the building has and the robot's model lacks.
        faults: what goes wrong, in the order of the file.
        helper: who says the words for which the robot waits.
        moved: things that stand elsewhere than in the robot's model.
        rides: who presses the buttons of elevators.
        truth: what differs from the robot's model.
        light: lamps, daylight and how the camera adapts; None: light that is the same everywhere.
        walkers: who walks there; None: nobody.
    """

    details: tuple[Path, ...]
    limits: ScenarioLimits
    camera: CameraSettings
    render: Render
    actuator: ActuatorParameters
    sensor: SensorParameters
    bumper: Bumper
    ranges: RangeRing
    faults: tuple[Fault, ...] = ()
    helper: tuple[Attendant, ...] = ()
    moved: tuple[MovedThing, ...] = ()
    rides: tuple[Helper, ...] = ()
    truth: TruthTable = NO_DIFFERENCES
    light: Lighting | None = None
    walkers: Company | None = None

    def refused(self, key: Key, why: str) -> ScenarioError:
        """The error to raise where one of its values does not fit the building."""
        return ScenarioError(f"{self.source.place(key)}: {why}")


def load_scenario(path_or_name: str | Path) -> Scenario:
    """Read a scenario by its name or from a file.

    Raises:
        ScenarioError: there is none, or it is malformed.
    """
    path = Path(path_or_name)
    if path.suffix != ".toml":
        known = find_scenarios()
        if str(path_or_name) not in known:
            if Path(path_or_name).is_dir():
                raise ScenarioError(f"scenario: expected a name or a TOML file, got the directory {path_or_name}")
            near = suggest_keys(str(path_or_name), list(known))
            raise ScenarioError(f"scenario: expected {near}, got {path_or_name!r}")
        path = known[str(path_or_name)]
    return _scenario(lambda: Source.read(path), path.stem, path.parent)


def parse_scenario(text: str, name: str = "scenario", folder: Path = SCENARIOS) -> Scenario:
    """Read a scenario from text; file names in it are relative to ``folder``. Raises ScenarioError."""
    return _scenario(lambda: Source.parse(text, name), name, folder)


def scenario_from_tables(data: Mapping[str, Any], name: str, folder: Path) -> Scenario:
    """The scenario of tables as its source holds them. Raises ScenarioError."""
    return _scenario(lambda: Source(name, data), name, folder)


def with_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """The scenario with some settings replaced, as ``{"servo.action": "off", "start.heading_deg": 90}``.

    Raises:
        ScenarioError: a key is unknown (near ones are listed) or a value is of the wrong kind.
    """
    return _scenario(lambda: FORMAT.with_settings(scenario.source, settings), scenario.name, scenario.folder)


def _scenario(read: Callable[[], Source], name: str, folder: Path) -> Scenario:
    try:
        source = read()
        shared, node = FORMAT.read(source, name, folder), source.root
        details = [item.text() for item in node["details"].items()] if "details" in node else []
        if len(details) > MOST_DETAILS:
            raise node["details"].fail(f"at most {MOST_DETAILS} files", str(len(details)))
        return Scenario(
            details=tuple(named_file(text, ROOT / "sim" / "buildings", folder) for text in details),
            faults=tuple(read_fault(item) for item in node["faults"].items()) if "faults" in node else (),
            helper=read_all(node, "helper", Attendant),
            moved=read_all(node, "moved", MovedThing),
            rides=read_all(node, "rides", Helper),
            truth=read_settings(node["truth"], TruthTable) if "truth" in node else NO_DIFFERENCES,
            light=read_settings(node["light"], Lighting) if "light" in node else None,
            walkers=_read_walkers(node["walkers"]) if "walkers" in node else None,
            **shared,
        )
    except WorldError as error:
        raise ScenarioError(str(error)) from None


def _read_walkers(node: Node) -> Company:
    if needs := list_absent("harvey.movers").get("walkers"):
        raise WorldError(f"{node.place}: it needs {needs}")
    company: Company = load_plugins("harvey.movers", Company, "walkers")["walkers"].read(node)
    return company
