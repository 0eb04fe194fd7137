"""Changes of a building, from when to when: a door's leaf, faces that are there or gone, and each state of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.body.collision import Obstacles
from sim.ground_truth.table import Lasting, TrueDoor
from sim.ground_truth.things import OAK, STEEL
from sim.render.lights import Lights
from sim.render.renderer import Renderer
from world_models.building.geometry.faces import Face
from world_models.building.geometry.solids import Box, Range, Solid
from world_models.building.locales import Doorway
from world_models.files.construction.doors import LEAF_DEPTH_M
from world_models.files.construction.rooms import CASING_DEPTH_M
from world_models.frames import Pose

THICKNESS_M = 0.045
HANDLE_M: tuple[Range, Range, float] = ((0.05, 0.13), (0.98, 1.06), 0.05)
"""Of a door handle: how far from the leaf's free edge, how high, how far off the leaf."""


def build_leaf(door: TrueDoor, doorway: Doorway, floor_m: float) -> tuple[Face, ...]:
    """The faces of a leaf. A shut one fills its opening, set back as the model's closed doors are.

    One that is ajar is hinged at a jamb before the casing, and swings into ``door.into``.
    """
    locale = door.into or doorway.between[0]
    left, right = doorway.threshold_of(locale)
    hinge, free = (left, right) if door.hinge == "left" else (right, left)
    inward = -doorway.outward_from(locale)
    along = (free - hinge) / np.linalg.norm(free - hinge)
    side = float(np.sign(along[0] * inward[1] - along[1] * inward[0]))
    is_shut = door.state == "shut"
    foot = hinge + (-LEAF_DEPTH_M if is_shut else CASING_DEPTH_M) * inward
    turn_rad = math.atan2(along[1], along[0]) + (0.0 if is_shut else side * door.open_rad)
    world_from_leaf = Pose.from_rotation_vector(np.array([0.0, 0.0, turn_rad]), np.array([*foot, floor_m]))
    across = (-THICKNESS_M, 0.0) if side > 0.0 else (0.0, THICKNESS_M)
    width = doorway.width_m
    (near, far), heights, off = HANDLE_M
    boxes = (Box((0.0, width), across, (0.0, doorway.height_m), OAK),
             Box((width - far, width - near), (across[0] - off, across[1] + off), heights, STEEL))
    return tuple(Solid(f"{doorway.name}/true-leaf", boxes, world_from_leaf).faces(locale))


@dataclass(frozen=True, eq=False)
class TrueChange:
    """One difference from the model.

    Attributes:
        lasting: from when to when it holds.
        about: the name of the door or thing; of several changes about the same, the last one that is due holds.
        gone: names of the faces that are not there.
        added: faces that are there.
    """

    lasting: Lasting
    about: str
    gone: frozenset[str] = frozenset()
    added: tuple[Face, ...] = ()


def find_active(changes: Sequence[TrueChange], time_s: float) -> tuple[int, ...]:
    """Which changes hold at a time, ascending."""
    due = {change.about: i for i, change in enumerate(changes)
           if change.lasting.at_s <= time_s < change.lasting.until_s}
    return tuple(sorted(due.values()))


def compare_faces(lasting: Lasting, about: str, before: Sequence[Face], after: Sequence[Face]) -> TrueChange:
    """The change from some faces to others."""
    known = {face.name: face for face in before}
    kept = {face.name for face in after if face.name in known and _is_same(face, known[face.name])}
    return TrueChange(lasting, about, frozenset(known.keys() - kept), tuple(f for f in after if f.name not in kept))


def _is_same(one: Face, other: Face) -> bool:
    sides = ((one.front, other.front), (one.back, other.back))
    return all(len(a) == len(b) for a, b in sides) and all(
        x.colour == y.colour and np.array_equal(x.polygon_world, y.polygon_world)
        for a, b in sides for x, y in zip(a, b, strict=True))


State = tuple[int, ...]
"""The changes that hold, by number."""


class ChangingFaces:
    """The faces of a building with its changes.

    What no change concerns is prepared once, and shared by all states; with ``lights`` each state is lit by itself.
    """

    def __init__(
        self, faces: Sequence[Face], changes: Sequence[TrueChange] = (), samples: int = 8, lights: Lights | None = None
    ) -> None:
        self._changes = tuple(changes)
        passing = frozenset[str]().union(*(change.gone for change in self._changes))
        self._lasting = tuple(face for face in faces if face.name not in passing)
        self._passing = tuple(face for face in faces if face.name in passing)
        self._samples, self._lights = samples, lights
        self._renderer = None if lights else Renderer.of_faces(self._lasting, samples)
        self._renderers: dict[State, Renderer] = {}
        self._obstacles: dict[float, Obstacles] = {}

    @property
    def is_changing(self) -> bool:
        """Whether there are any changes."""
        return bool(self._changes)

    def state_at(self, time_s: float) -> State:
        """The state at a time of the run."""
        return find_active(self._changes, time_s)

    def added(self, state: State) -> tuple[Face, ...]:
        """The faces that are there, and are not without the changes."""
        return tuple(face for i in state for face in self._changes[i].added)

    def gone(self, state: State) -> tuple[Face, ...]:
        """The faces that are not there, and are without the changes."""
        names = frozenset[str]().union(*(self._changes[i].gone for i in state))
        return tuple(face for face in self._passing if face.name in names)

    def renderer(self, state: State) -> Renderer:
        """What is seen."""
        if state not in self._renderers:
            self._renderers[state] = self._build_renderer(state)
        return self._renderers[state]

    def _build_renderer(self, state: State) -> Renderer:
        if self._lights is not None:
            return self._lights.renderer((*self._lasting, *self._varying(state)), self._samples)
        assert self._renderer is not None
        return self._renderer.with_faces(self._varying(state))

    def obstacles(self, state: State, floor_m: float) -> Obstacles:
        """What is solid for a robot on the floor of this height [m]."""
        if floor_m not in self._obstacles:
            self._obstacles[floor_m] = Obstacles.of_faces(self._lasting, floor_m)
        return self._obstacles[floor_m].with_faces(self._varying(state), floor_m)

    def _varying(self, state: State) -> tuple[Face, ...]:
        gone = {face.name for face in self.gone(state)}
        return (*(face for face in self._passing if face.name not in gone), *self.added(state))
