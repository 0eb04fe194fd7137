"""Scenarios: a mission, the body that tries it and what goes wrong, written in TOML."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from sim.body.actuator import ActuatorParameters
from sim.body.elevator import Helper
from sim.faults.fault_table import read_fault
from sim.faults.faults import Fault
from sim.moved_things import Moved
from sim.render.optics import check_lens
from sim.render.rasterizer import sample_offsets
from sim.render.sensor import SensorParameters
from world_models.bounds import Bounds, check_bounds
from world_models.camera import Camera, CameraMount
from world_models.files.compiled.schema import SUFFIXES
from world_models.files.toml.settings import MOST, known_keys, merged, near, parsed, read_settings
from world_models.files.toml.source import Key, Node, Source, WorldError
from world_models.phrases import check_command

ROOT = Path(__file__).resolve().parent.parent
SCENARIOS = ROOT / "sim" / "scenarios"
MOST_BENT = 1e4
"""Coefficients of real lenses are about 1, of long ones some hundreds."""
TURN = Bounds(-2.0 * math.pi, 2.0 * math.pi)


class ScenarioError(ValueError):
    """A scenario that cannot be read: names the file, the line or key, what was expected and what came."""


@dataclass(frozen=True, slots=True)
class Start:
    """How the robot is put down: heading in the first locale's frame, and how badly it is placed."""

    heading_rad: float = 0.0
    put_down_sigma_m: float = 0.0
    put_down_sigma_rad: float = 0.0

    def __post_init__(self) -> None:
        check_bounds(self, {"heading_rad": TURN, "put_down_sigma_m": Bounds(0.0, 2.0),
                            "put_down_sigma_rad": Bounds(0.0, math.pi)})


@dataclass(frozen=True, slots=True)
class Arrival:
    """The heading wanted at the goal, in the last locale's frame; NaN for any."""

    heading_rad: float = math.nan

    def __post_init__(self) -> None:
        if self.matters:
            check_bounds(self, {"heading_rad": TURN})

    @property
    def matters(self) -> bool:
        return not math.isnan(self.heading_rad)


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """The camera and how it is mounted; distortion: none, or k1, k2, p1, p2[, k3] as OpenCV has them."""

    width_px: int = 512
    height_px: int = 512
    field_of_view_rad: float = math.radians(65.0)
    mount_height_m: float = 1.0
    mount_forward_m: float = 0.1
    mount_tilt_rad: float = 0.0
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        side = Bounds(16, 4096)
        check_bounds(self, {"width_px": side, "height_px": side, "field_of_view_rad": Bounds(0.05, 2.6),
                            "mount_height_m": Bounds(0.0, 5.0, above=True),
                            "mount_forward_m": Bounds(-2.0, 2.0),
                            "mount_tilt_rad": Bounds(-math.pi / 2.0, math.pi / 2.0)})
        bent = max((abs(k) for k in self.distortion), default=0.0)
        if bent > MOST_BENT:
            raise ValueError(f"expected distortion coefficients of at most {MOST_BENT:g} in size, got one of {bent:g}")
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
    """Samples a pixel: 1, 4, 8 or 16."""

    samples: int = 8

    def __post_init__(self) -> None:
        sample_offsets(self.samples)


@dataclass(frozen=True, slots=True)
class Servo:
    """Which levels of perceptual servoing (Figure 2) are on."""

    action: bool = True
    plan: bool = True
    goal: bool = True


@dataclass(frozen=True, slots=True)
class Motion:
    """Whether legs are driven without stopping at each increment: corrected on the move, thirty times a second."""

    continuous: bool = False


@dataclass(frozen=True, slots=True)
class Limits:
    """When to give up."""

    max_time_s: float = 3600.0
    max_cycles: int = 20000
    max_path_m: float = 150.0
    max_collisions: int = 3

    def __post_init__(self) -> None:
        some = Bounds(0.0, MOST, above=True)
        check_bounds(self, {"max_time_s": some, "max_cycles": some, "max_path_m": some,
                            "max_collisions": Bounds(0, MOST)})


SECTIONS: Mapping[str, type[Any]] = {
    "start": Start,
    "arrival": Arrival,
    "camera": CameraSettings,
    "render": Render,
    "actuator": ActuatorParameters,
    "sensor": SensorParameters,
    "servo": Servo,
    "motion": Motion,
    "limits": Limits,
}
TEXTS = ("description", "world", "goal")


@dataclass(frozen=True, eq=False)
class Scenario:
    """One mission; the tables of the file are the attributes of the same name.

    Attributes:
        name: the file's, without its ending.
        world: the world file that the robot believes in; details: the files of what only the building has.
        goal: in conceptual-dependency form, coordinates in feet.
        faults: what goes wrong, in the order of the file.
        moved: what stands elsewhere in the building than in the robot's model.
        rides: who presses the buttons of elevators.
        folder, data: where the file is, and its tables as read, for :func:`with_settings`.
        source: the file, to point at; settings: the keys that were set otherwise than there.
    """

    name: str
    description: str
    world: Path
    details: tuple[Path, ...]
    goal: str
    start: Start
    arrival: Arrival
    camera: CameraSettings
    render: Render
    actuator: ActuatorParameters
    sensor: SensorParameters
    servo: Servo
    motion: Motion
    limits: Limits
    faults: tuple[Fault, ...] = ()
    moved: tuple[Moved, ...] = ()
    rides: tuple[Helper, ...] = ()
    folder: Path = SCENARIOS
    data: Mapping[str, Any] = field(default_factory=dict, repr=False)
    source: Source = field(default=Source("scenario", {}, {}), repr=False)
    settings: tuple[str, ...] = ()

    def refused(self, key: Key, why: str) -> ScenarioError:
        """What to raise where one of its values does not go with the building."""
        path = ".".join(str(part) for part in key)
        where = f"--set {path}" if path in self.settings else f"{self.source.where(key)}: {path}"
        return ScenarioError(f"{where}: {why}")


def list_scenarios() -> tuple[str, ...]:
    """The names of the scenarios that come with the project."""
    return tuple(sorted(path.stem for path in SCENARIOS.glob("*.toml")))


def load_scenario(path_or_name: str | Path) -> Scenario:
    """Read a scenario by its name or from a file.

    Raises:
        ScenarioError: there is none, or it is malformed.
    """
    path = Path(path_or_name)
    if path.suffix != ".toml":
        path = SCENARIOS / f"{path_or_name}.toml"
        if str(path_or_name) not in list_scenarios():
            raise ScenarioError(f"scenario: expected {near(str(path_or_name), list_scenarios())}, got {path_or_name!r}")
    try:
        return _scenario(Source.read(path), path.stem, path.parent)
    except WorldError as error:
        raise ScenarioError(str(error)) from None


def parse_scenario(text: str, name: str = "scenario", folder: Path = SCENARIOS) -> Scenario:
    """Read a scenario from text; file names in it are relative to ``folder``. Raises ScenarioError."""
    try:
        return _scenario(Source.parse(text, name), name, folder)
    except WorldError as error:
        raise ScenarioError(str(error)) from None


def scenario_from_tables(data: Mapping[str, Any], name: str, folder: Path) -> Scenario:
    """The scenario of tables as :attr:`Scenario.data` holds them. Raises ScenarioError."""
    try:
        return _scenario(Source(name, data, {}), name, folder)
    except WorldError as error:
        raise ScenarioError(str(error)) from None


def with_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """The scenario with some settings replaced, as ``{"servo.action": "off", "start.heading_deg": 90}``.

    Raises:
        ScenarioError: a key is unknown (near ones are listed) or a value is of the wrong kind.
    """
    for key, value in settings.items():
        scenario = _with_setting(scenario, key, parsed(value) if isinstance(value, str) else value)
    return scenario


def setting_keys() -> tuple[str, ...]:
    """Every key that :func:`with_settings` understands."""
    return (*TEXTS, *(f"{name}.{key}" for name, kind in SECTIONS.items() for key in known_keys(kind)))


def _with_setting(scenario: Scenario, key: str, value: Any) -> Scenario:
    if key not in setting_keys():
        raise ScenarioError(f"--set {key}: expected {near(key, setting_keys())}, got {key!r}")
    path = tuple(key.split("."))
    data = scenario.data
    if len(path) == 2:
        same = known_keys(SECTIONS[path[0]])
        kept = {k: v for k, v in data.get(path[0], {}).items() if same[k][0] != same[path[1]][0]}
        data = {**data, path[0]: kept}
    try:
        changed = _scenario(Source("--set", merged(data, path, value), {}), scenario.name, scenario.folder)
        return replace(changed, source=scenario.source, settings=(*scenario.settings, key))
    except WorldError as error:
        raise ScenarioError(f"--set {key}: {str(error).partition(': ')[2].removeprefix(f'{key}: ')}") from None


def _scenario(source: Source, name: str, folder: Path) -> Scenario:
    node = source.root.table(("world", "goal"), ("description", "details", "faults", "moved", "rides", *SECTIONS))
    sections = {key: read_settings(node[key], kind) if key in node else kind() for key, kind in SECTIONS.items()}
    details = [item.text() for item in node["details"].items()] if "details" in node else []
    return Scenario(
        name=name,
        description=node["description"].text() if "description" in node else "",
        world=_file(node["world"].text(), ROOT / "world_models" / "worlds", folder),
        details=tuple(_file(text, ROOT / "sim" / "buildings", folder) for text in details),
        goal=_goal(node["goal"]),
        faults=tuple(read_fault(item) for item in node["faults"].items()) if "faults" in node else (),
        moved=tuple(read_settings(item, Moved) for item in node["moved"].items()) if "moved" in node else (),
        rides=tuple(read_settings(item, Helper) for item in node["rides"].items()) if "rides" in node else (),
        folder=folder,
        data=source.data,
        source=source,
        **sections,
    )


def _file(text: str, shipped: Path, folder: Path) -> Path:
    """A file that comes with the project, by its bare name, or any file, relative to the scenario's folder."""
    return folder / text if text.endswith((".toml", *SUFFIXES)) else shipped / f"{text}.toml"


def _goal(node: Node) -> str:
    try:
        check_command(node.text())
    except WorldError:
        raise
    except ValueError as error:
        raise WorldError(f"{node.where}: goal: {error}") from None
    return node.text()
