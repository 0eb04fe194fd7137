"""Laws of exploring: a picture tells axes and feet of walls, the map is found, and what is written is the building."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harvey.cli import main
from harvey_survey.axis_map import AxisMap, LearntRoom
from harvey_survey.axis_view import FloorLooks, see_axes
from harvey_survey.explore_command import build_explored_stage, build_explorer
from harvey_survey.explore_experiment import compare_models, lay_into_world, write_bare_floor
from harvey_survey.explorer import Explorer, ExploringStopped
from harvey_survey.learnt_world import write_learnt_world
from harvey_survey.seen_floor import SeenFloor, cell_of
from sim.body.simulated_body import SimulatedBody
from sim.stage import Stage
from world_models.entries import Contact
from world_models.files.world_files import load_world
from world_models.frames import Pose2, wrap_angle

SEED, ROOMS = 7009, 2


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bare_floor(tmp_path_factory.mktemp("explore"), SEED, ROOMS)


@pytest.fixture(scope="module")
def stage(file: Path) -> Stage:
    return build_explored_stage(file, [("room-0-north-0", 1.5, 1.6)] * 2, 37.0)


@dataclass
class KeptBody:
    """A body whose answers are kept; those that are there already are given before its own."""

    body: SimulatedBody
    answers: list[Any] = field(default_factory=list)
    given: int = 0

    def __getattr__(self, name: str) -> Any:
        def answer(*asked: Any) -> Any:
            own = getattr(self.body, name)(*asked)
            self.answers[self.given :] = self.answers[self.given :] or [own]
            self.given += 1
            return self.answers[self.given - 1]

        return answer


@pytest.fixture(scope="module")
def explored(stage: Stage) -> tuple[Explorer, SimulatedBody, Pose2]:
    """An explorer at home again, its body, and the true start."""
    body = stage.body(0)
    start, explorer = body.truth.world_from_robot, build_explorer(stage, body)
    explorer.explore()
    return explorer, body, start


def test_a_picture_tells_the_heading_and_how_well(stage: Stage) -> None:
    body, seen = stage.body(1), stage.scenario.camera
    for _ in range(4):
        true = body.truth.world_from_robot.heading_rad
        view = see_axes(body.look("").jpeg, seen.camera, seen.mount, true + 0.3)
        assert view is not None
        assert abs(wrap_angle(view.heading_rad - true)) < 4.0 * view.sigma_rad < math.radians(1.0)
        body.turn(math.pi / 2.0)


def test_a_picture_without_lines_tells_nothing(stage: Stage) -> None:
    import cv2

    seen = stage.scenario.camera
    blank = cv2.imencode(".jpg", np.full((seen.height_px, seen.width_px, 3), 120, np.uint8))[1].tobytes()
    assert see_axes(blank, seen.camera, seen.mount, 0.0) is None


def test_the_map_is_found_by_linear_equations() -> None:
    built = AxisMap()
    room = built.rooms["room"] = LearntRoom("room", FloorLooks(np.zeros(3), np.eye(3), np.zeros(3)))
    built.add_stand(np.zeros(2), np.zeros(2), [], "room")
    built.add_stand(np.array([2.0, 0.0]), np.full(2, 0.01), [], "room")
    built.set_wall(room, 1, 5.0)
    for stand, off in ((0, 5.1), (1, 3.0)):  # the wheels said 2, the wall says 2.1
        built.measure_wall(stand, "room", 1, off, 0.002)
    built.measure_wall(1, "room", 1, 4.0, 0.002)  # another wall
    built.solve()
    assert built.position(1)[0] == pytest.approx(2.1, abs=0.01)
    assert room.walls[1] == pytest.approx(5.1, abs=0.01)
    assert 0.0 < built.sigmas["stand", 1, 0] < 0.01 < built.sigmas["stand", 1, 1]


def test_no_way_leads_through_a_wall_but_by_a_doorway() -> None:
    floor = SeenFloor(0.35)
    for x in (0.0, 2.0):
        floor.add_way(np.array([x, -2.0]), np.array([x, 2.0]), 2.1)
    floor.add_box(np.array([1.0, -4.0]), np.array([1.08, 4.0]), False)
    assert cell_of((2.0, 0.0)) not in floor.costs_from(np.zeros(2))[0]
    floor.add_box(np.array([0.9, -0.5]), np.array([1.2, 0.5]), True)
    costs, before = floor.costs_from(np.zeros(2))
    assert floor.way_to(cell_of((2.0, 0.0)), before)
    assert costs[cell_of((2.0, 0.0))] >= 1.9 and cell_of((4.0, 0.0)) not in costs
    assert floor.find_clearance(np.zeros(2), np.array([2.0, 0.0])).p.max() == 1.0  # between jambs it creeps


def test_what_is_explored_is_the_building(
    file: Path, tmp_path: Path, explored: tuple[Explorer, SimulatedBody, Pose2]
) -> None:
    explorer, body, start = explored
    learnt = tmp_path / "learnt.toml"
    learnt.write_text(write_learnt_world(explorer.map, "learnt"), "utf-8")
    found = compare_models(load_world(file), load_world(lay_into_world(learnt, start, explorer.start_rad)))
    assert (found.found_rooms, found.false_rooms) == (found.rooms, 0)
    assert (found.found_doors, found.false_doors) == (found.doors, 0)
    assert float(np.median(found.walls_m)) < 0.03
    assert found.angle_deg < 0.3
    assert (body.truth.collisions, body.truth.world_from_robot.distance_to(start) < 0.1) == (0, True)


def test_it_has_seen_the_floor_where_it_drove(explored: tuple[Explorer, SimulatedBody, Pose2]) -> None:
    explorer, body, start = explored
    axes_from_world = (start @ Pose2(0.0, 0.0, -explorer.start_rad)).inverse()
    seen = explorer.floor.seen
    track = np.array([truth.world_from_robot.position for truth in body.track])
    assert all(seen[cell_of(point)] for point in axes_from_world.apply(track))


def test_an_exploration_continued_is_the_exploration_done_at_once(stage: Stage) -> None:
    first = KeptBody(stage.body(3))
    begun = build_explorer(stage, first)  # type: ignore[arg-type]
    begun.take_step()
    begun.take_step()
    kept = len(first.answers)
    begun.take_step()
    again = KeptBody(stage.body(3), first.answers[:kept])
    continued = build_explorer(stage, again)  # type: ignore[arg-type]
    for _ in range(3):
        continued.take_step()
    assert continued.map.values == begun.map.values
    assert np.array_equal(continued.floor.seen, begun.floor.seen)


def test_a_contact_stops_it(stage: Stage) -> None:
    body = KeptBody(stage.body(3))
    explorer = build_explorer(stage, body)  # type: ignore[arg-type]
    explorer.take_step()
    touched = Contact("bumper", 0.0, 0.1, 0.0)
    body.take_contact = lambda: touched  # type: ignore[method-assign]
    with pytest.raises(ExploringStopped, match="touched"):
        explorer.take_step()


@pytest.mark.parametrize(("more", "expected"), [
    (["--out", "learnt.txt"], "ends in .toml"), (["--out", "x.toml", "--start", "nowhere"], "--start: expected a room"),
])
def test_the_command_says_what_it_expects(
    file: Path, more: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explore", "--world", str(file), "--start", "room-0-north-0", *more]) == 2
    assert expected in capsys.readouterr().err
