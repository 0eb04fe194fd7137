"""Run head: what a run directory tells from its first moment, ``run.json``: enough to decide the run again or go on."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

from blackboard import MisfitError, decode, fields_of, plain
from logs.decided_by import arithmetic, calculating_libraries, deciding_code
from logs.disk import write_whole
from logs.run_directory import JOURNAL_VERSION, read_json, refuse_version
from logs.run_errors import BadInput
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.camera import NOT_STATED, Camera, CameraDeviation, CameraMount
from world_models.entries import Command
from world_models.files.toml.mission import ROOT, Servo
from world_models.files.world_files import fingerprint, load_world
from world_models.plugins import SOURCES_GROUP, list_plugins
from world_models.robot import RobotModel

MOST_IN_HEAD = 1_000
"""Letters of a name, and constants."""
SIMULATOR, HARDWARE = "simulator", "hardware"
PARTS: Mapping[str, type[Any]] = {
    "camera": Camera, "mount": CameraMount, "actuator": ActuatorModel, "deviation": CameraDeviation}
"""What a robot knows of itself that has parts of its own."""
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class RunHead:
    """How a run began.

    Attributes:
        kind: simulator or hardware.
        name: of the scenario or mission.
        seed: of all chance in the simulator; 0 on hardware.
        world: the world file that the robot believes in; relative to the project where it comes with it.
        world_sha256: of that file's bytes.
        robot: what the robot knows of itself, without the world, as JSON types.
        servo: which levels of perceptual servoing are on.
        command: what the user asked for, as JSON types.
        without, constants: what was taken from the agent or set otherwise, in a counterfactual run.
        scenario: simulator: the scenario's tables as read, with ``--set`` applied; hardware: what the driver needs.
        folder: simulator: where the scenario's file was.
        body: simulator: how the body is reached, as :func:`harvey.simulation.serial_body.open_body` knows it.
        harvey: version; code: what :func:`~logs.decided_by.deciding_code` says of the deciding program,
            "" in a run that is older than that.
        plugins: the knowledge sources of other packages that decide too: name -> package and version.
        arithmetic: how the libraries calculated, as :func:`logs.decided_by.arithmetic` tells; "" in an older run.
        libraries: versions of those that calculate, by name; none in an older run.
        journal_version: of the names in its journal; only this program's own is read.
    """

    kind: str
    name: str
    seed: int
    world: str
    world_sha256: str
    robot: Mapping[str, Any]
    servo: Mapping[str, bool]
    command: Mapping[str, Any]
    without: tuple[str, ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    scenario: Mapping[str, Any] = field(default_factory=dict)
    folder: str = ""
    body: str = "simulated"
    harvey: str = field(default_factory=lambda: version("harvey"))
    code: str = field(default_factory=deciding_code)
    arithmetic: str = field(default_factory=arithmetic)
    plugins: Mapping[str, str] = field(default_factory=lambda: dict(list_plugins(SOURCES_GROUP)))
    libraries: Mapping[str, str] = field(default_factory=calculating_libraries)
    journal_version: int = JOURNAL_VERSION

    @staticmethod
    def of(
        kind: str, name: str, seed: int, world: Path, robot: RobotModel, servo: Servo, command: Command, **more: Any
    ) -> RunHead:
        """The head of a run that begins now; ``more`` are the other attributes. Raises OSError for the world file."""
        known = {f.name: getattr(robot, f.name) for f in fields(robot) if f.init and f.name not in ("world", "lens")}
        known["camera"] = robot.lens  # the robot's model is made of the camera as it is, with its lens
        if robot.deviation == NOT_STATED:
            del known["deviation"]
        return RunHead(
            kind, name, seed, portable(world), fingerprint(world), plain(known), asdict(servo), plain(command), **more
        )

    def write(self, folder: Path) -> None:
        """Write ``run.json``. Raises OSError."""
        write_whole(folder / "run.json", json.dumps(asdict(self), indent=2) + "\n")

    @staticmethod
    def read(folder: Path) -> RunHead:
        """Raises BadInput where ``run.json`` is missing or malformed, or the journal of another version."""
        path = folder / "run.json"
        data = read_json(path, "the head of a run")
        try:
            older = {"code": "", "arithmetic": "", "plugins": {}, "libraries": {}, "journal_version": 1}
            head: RunHead = decode({**older, **data} if isinstance(data, dict) else data, RunHead)
            if (many := max(len(head.name), len(head.constants))) > MOST_IN_HEAD:
                raise ValueError(f"expected a name and constants of at most {MOST_IN_HEAD}, got {many}")
        except (ValueError, TypeError) as error:
            raise BadInput(f"{path}: {error}") from None
        refuse_version(folder, head.journal_version)
        return head

    def is_like(self, other: RunHead) -> bool:
        """Whether both runs began alike, whichever program decides."""
        one, two = (replace(head, code="", arithmetic="", libraries={}) for head in (self, other))
        return json.dumps(asdict(one)) == json.dumps(asdict(two))

    def here(self) -> RunHead:
        """The same, for a run that this program decides."""
        return replace(self, harvey=version("harvey"), code=deciding_code(), arithmetic=arithmetic(),
                       libraries=calculating_libraries())

    def decided_elsewhere(self) -> str:
        """What to say of a run that another program or processor decided than this; "" where none is known of."""
        here = self.here()
        if self.harvey != here.harvey:
            return f"was decided by version {self.harvey} of harvey, and this is {here.harvey}"
        if self.code and self.code != here.code:
            return f"was decided by other code than this ({self.code} by its run.json, and here {here.code})"
        installed = list_plugins(SOURCES_GROUP)
        for name, package in self.plugins.items():
            if name in installed and installed[name] != package:
                return f"was decided with {name} of {package}, and here it is of {installed[name]}"
        for name, theirs in self.libraries.items():
            if theirs != (ours := here.libraries.get(name, "not installed")):
                return f"was calculated by {name} {theirs}, and here it is {ours}"
        if self.arithmetic and self.arithmetic != here.arithmetic:
            return f"was calculated on another processor ({self.arithmetic}, and this is {here.arithmetic})"
        return ""

    def load_world(self) -> World:
        """The world that the robot believes in. Raises BadInput where its file has changed since."""
        path = ROOT / self.world
        if not path.is_file() or fingerprint(path) != self.world_sha256:
            raise BadInput(f"{path}: expected the world file as it was when the run was made, got another or none")
        return _world(path, self.world_sha256)

    def model(self, world: World) -> RobotModel:
        """The robot as it knows itself, in a world. Raises BadInput where a value cannot be used."""
        return _build("robot", lambda: RobotModel(world, **self._robot_fields()))

    def task(self) -> Command:
        """What the user asked for. Raises BadInput."""
        return _build("command", lambda: _whole(self.command, Command))

    def servo_settings(self) -> Servo:
        """Which levels are on. Raises BadInput."""
        return _build("servo", lambda: _whole(self.servo, Servo))

    def _robot_fields(self) -> dict[str, Any]:
        """What the robot knows of itself; a run of an older version may lack what has a default. Raises ValueError."""
        parts = {name: self.robot[name] for name in PARTS if name in self.robot}
        rest = {name: value for name, value in self.robot.items() if name not in parts}
        made = fields_of(rest, RobotModel)
        for name, value in parts.items():
            try:
                made[name] = _whole(value, PARTS[name])
            except (TypeError, ValueError) as error:
                raise MisfitError.within(name, error) from None
        return made


def load_known_world(path: Path) -> World:
    """The world of a file as it is now; runs that begin in one process with the same world share what they know of it.

    Raises WorldError, OSError.
    """
    return _world(ROOT / portable(path), fingerprint(path))


@lru_cache(maxsize=1)  # with all that was computed of it: some 100 MB for a large floor
def _world(path: Path, _sha256: str) -> World:
    return load_world(path)


def _build(what: str, make: Callable[[], T]) -> T:
    """Build a part of ``run.json``. Raises BadInput, which names the value, where one cannot be used."""
    try:
        return make()
    except (TypeError, ValueError) as error:
        raise BadInput(f"run.json: {MisfitError.within(what, error)}") from None


def _whole(value: Any, kind: type[T]) -> T:
    """A dataclass from JSON types. Raises TypeError, ValueError."""
    if not isinstance(value, dict):
        raise ValueError(f"expected an object, got {value!r}")
    lacking = [f.name for f in fields(cast(Any, kind))
               if f.name not in value and f.default is MISSING and f.default_factory is MISSING]
    if lacking:
        raise ValueError(f"expected {', '.join(lacking)} as well, got {', '.join(value) or 'nothing'}")
    return kind(**fields_of(value, kind))


def portable(path: Path) -> str:
    """A path that also holds where the project lies elsewhere."""
    there = path.resolve()
    return str(there.relative_to(ROOT)) if there.is_relative_to(ROOT) else str(there)
