"""What is seen and what is solid in a building that changes; each of its states is built once."""

from __future__ import annotations

from collections.abc import Sequence

from sim.body.collision import Obstacles
from sim.differences.change import Change, find_active
from sim.render.light.lights import Lights
from sim.render.renderer import Renderer
from world_models.building.geometry.faces import Face

State = tuple[int, ...]
"""The changes that hold, by number."""


class ChangingFaces:
    """The faces of a building with its changes.

    What no change concerns is prepared once, and shared by all states; with ``lights`` each state is lit by itself.
    """

    def __init__(
        self, faces: Sequence[Face], changes: Sequence[Change] = (), samples: int = 8, lights: Lights | None = None
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
