"""Laws of how well a model knows its lines: what is stated, what is shared, and how it is kept."""

from __future__ import annotations

import numpy as np

from experiments.generated.floors import generated_floor
from world_models.building.model_errors import MEASURED_M, find_line_errors, find_sigma_m, pack_errors, unpack_errors
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

FLOOR = generated_floor(0, 4, open_share=1.0)


def read(first_line: str = "") -> World:
    return read_world(Source.parse(f"{first_line}\n{FLOOR.text}", "floor"))


def test_an_unstated_model_is_right_as_measured() -> None:
    world = read()
    marks = [mark for mark in world.landmarks for _ in mark.lines_world]
    numbers = [i for mark in world.landmarks for i in range(len(mark.lines_world))]
    errors = find_line_errors(world, marks, numbers)
    assert errors.is_exact and errors.displacements.shape == (0, len(marks), 3)
    assert pack_errors(errors) == ()
    measured = find_line_errors(world, marks, numbers, MEASURED_M)
    assert measured.is_exact and np.all(np.any(measured.displacements != 0.0, axis=(0, 2)))
    assert not measured.restate(0.03).is_exact
    assert np.allclose(measured.restate(0.03).displacements, 3.0 * measured.displacements)


def test_stated_errors_are_shared_by_a_wall_and_by_a_thing() -> None:
    world = read("sigma_cm = 5")
    room = FLOOR.rooms[0]
    own = [mark for mark in world.landmarks if mark.locale == room]
    marks = [mark for mark in own for _ in mark.lines_world]
    numbers = [i for mark in own for i in range(len(mark.lines_world))]
    errors = find_line_errors(world, marks, numbers)
    assert find_sigma_m(world, room) == 0.05
    sizes = np.linalg.norm(errors.displacements, axis=2)
    assert np.allclose(sizes[sizes > 0.0], 0.05)
    things = {thing.name for thing in world.things_of(room)}
    for mark in own:
        rows = [i for i, of in enumerate(marks) if of is mark]
        assert np.any(sizes[:, rows] > 0.0)
        if mark.name in things:  # all its lines are displaced as one
            assert np.ptp(errors.displacements[:, rows], axis=1).max() == 0.0
    again = unpack_errors(errors.displacement_modes, pack_errors(errors), len(marks))
    assert np.array_equal(again.displacements, errors.displacements)


def test_a_part_may_be_known_better_than_the_rest() -> None:
    text = ('sigma_cm = 5\nname = "flat"\nunits = "metres"\n[finishes]\noak = { colour = [0.5, 0.4, 0.2] }\n'
            '[locales.one]\nkind = "room"\nsize = [4, 3]\nsigma_cm = 1\n'
            'things = [{ name = "box", at = [2, 2], sigma_cm = 8, finish = "oak", '
            'boxes = [{ x = [0, 0.4], y = [0, 0.4], z = [0, 0.5] }] }]\n'
            '[locales.two]\nkind = "room"\nat = [4.1, 0]\nsize = [4, 3]\n'
            '[doors.way]\nbetween = ["one", "two"]\nwall = "east"\nalong = 1.5\nopen = true\nsigma_cm = 3\n')
    world = read_world(Source.parse(text, "flat"))
    assert (find_sigma_m(world, "one"), find_sigma_m(world, "two")) == (0.01, 0.05)
    assert find_sigma_m(world, "one", "one/box") == 0.08
    assert find_sigma_m(world, "one", "way") == find_sigma_m(world, "two", "way") == 0.03


def test_a_wall_with_a_door_is_one_from_both_sides_and_what_the_door_cuts_moves_with_it() -> None:
    world = read("sigma_cm = 5")
    for door in world.doorways:
        jambs = np.concatenate(door.thresholds_world)
        ways = []
        for locale in door.between:
            walls = [m for m in world.landmarks if m.kind == "wall" and m.locale == locale]
            lines = [(m, i) for m in walls for i, line in enumerate(m.lines_world)
                     if np.linalg.norm(line[:, None, :2] - jambs, axis=2).min(axis=1).max() < 0.15]
            assert lines  # the ends of its baseboards
            errors = find_line_errors(world, [m for m, _ in lines], [i for _, i in lines])
            along = errors.displacements[errors.displacement_modes.index(f"{door.name} along")]
            assert np.allclose(np.linalg.norm(along, axis=1), 0.05) and np.allclose(along @ [0, 0, 1], 0.0)
            across = [name for name in errors.displacement_modes if " wall " in name]
            ways.append((across, errors.displacements[errors.displacement_modes.index(across[0]), 0], along[0]))
        (one, out, left), (other, back, right) = ways
        assert one == other and np.allclose(out, back) and np.allclose(left, right)
