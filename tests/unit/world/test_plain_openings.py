"""What a floor plan says: doorways without a frame, ``frame = "none"``, and no colours, ``colour = "unknown"``."""

import numpy as np
import pytest

import harvey
from harvey.errors import BadInput
from sim.render.mesh import DRAWN_GREY, build_mesh
from world_models.building.geometry.scene import build_scene
from world_models.building.world import World

WORLD = """
name = "two"
units = "metres"
[defaults]
kind = "room"
{defaults}
[locales.a]
size = [4, 5]
baseboard = "grey"
[locales.b]
at = [4.2, 0]
size = [4, 5]
[doors]
way = {{ between = ["a", "b"], wall = "east", along = 2.5, width = 1.0, height = 2.1, open = true{door} }}
shut = {{ between = ["a"], wall = "west", along = 2.5, width = 1.0, height = 2.1{door} }}
[finishes]
grey = {{ colour = [0.6, 0.6, 0.6] }}
"""


def build(defaults: str = "", door: str = "") -> World:
    return harvey.build_world(WORLD.format(defaults=defaults, door=door))


def lines_of(world: World, name: str) -> np.ndarray:
    return next(mark for mark in world.landmarks if mark.name == name).edges.lines_world


@pytest.mark.parametrize("world", [build('frame = "none"'), build(door=', frame = "none"')])
def test_a_plain_opening_has_its_own_edges_and_no_boards(world: World) -> None:
    lines = lines_of(world, "way")
    assert np.isin(lines[..., 0].round(9), (4.0, 4.2)).all() and np.isin(lines[..., 1].round(9), (2.0, 3.0)).all()
    assert np.isin(lines[..., 2].round(9), (0.0, 2.1)).all()
    upright = lines[np.ptp(lines[..., 2], axis=1) > 1.0]
    assert len(upright) == 4  # two jambs, each with an edge on either side of the wall
    assert not [face.name for face in world.faces if "casing" in face.name]
    assert {face.name.split("/")[-1] for face in world.faces if "way" in face.name} >= {
        "left-jamb", "right-jamb", "soffit", "threshold", "doorway"}


def test_a_frame_is_drawn_where_nothing_is_said() -> None:
    world = build()
    assert [face.name for face in world.faces if "casing" in face.name]
    assert lines_of(world, "way")[..., 1].min() == pytest.approx(1.9)


def test_the_baseboard_reaches_to_the_opening() -> None:
    plain, framed = ((lines_of(build(text), "a/east-wall")[..., 1] - 2.0) for text in ('frame = "none"', ""))
    assert np.abs(plain).min() < 1e-9
    assert np.abs(framed).min() == pytest.approx(0.1)


def test_a_closed_door_may_have_no_frame_either() -> None:
    world = build('frame = "none"')
    assert lines_of(world, "a/shut")[..., 1].min() == pytest.approx(2.0)
    assert [face.name for face in world.faces if face.name.endswith("shut/leaf")]


def test_a_frame_of_an_unknown_finish_is_refused() -> None:
    with pytest.raises(BadInput, match="one of the finishes grey"):
        build('frame = "nothing"')


PLAN = WORLD.replace("[0.6, 0.6, 0.6]", '"unknown"')
UNKNOWN = "\n".join(f'{key} = "grey"' for key in ("walls", "floor", "ceiling", "threshold"))


def test_a_plan_without_colours_has_the_same_lines_and_expects_no_colour() -> None:
    known, unknown = (harvey.build_world(text.format(defaults=f'frame = "none"\n{UNKNOWN}', door=""))
                      for text in (WORLD, PLAN))
    assert np.array_equal(lines_of(known, "way"), lines_of(unknown, "way"))
    assert np.isnan([region.colour for face in unknown.faces if "wall" in face.name for region in face.front]).all()
    eye = (1.0, 1.0, 1.2)
    shows = unknown.scene.edges.contrasts(eye)
    assert np.isfinite(shows).all()
    assert ((shows > 0.0) | (known.scene.edges.contrasts(eye) == 0.0)).all()  # all that shows with colours shows


def test_what_has_no_known_colour_is_drawn_grey_in_the_simulator() -> None:
    world = harvey.build_world(PLAN.format(defaults=UNKNOWN, door=""))
    mesh = build_mesh([face for face in world.faces if face.name.endswith("a/floor")])
    assert np.all(mesh.colours == DRAWN_GREY)


def test_an_unknown_colour_has_no_texture() -> None:
    with pytest.raises(BadInput, match="one of the keys colour, words, got 'texture'"):
        harvey.build_world(PLAN.format(defaults="", door="").replace('"unknown"', '"unknown", texture = "wood"'))


@pytest.mark.parametrize("frame", ["none", "grey"])
@pytest.mark.parametrize("height", [2.1, 2.7])
def test_an_opening_may_be_as_wide_and_as_high_as_its_wall(frame: str, height: float) -> None:
    text = WORLD.format(defaults=f'frame = "{frame}"', door="").replace("size = [4, 5]", "size = [4, 1.6]")
    text = text.replace("along = 2.5, width = 1.0, height = 2.1, o", f"along = 0.8, width = 1.6, height = {height}, o")
    world = harvey.build_world(text.replace("along = 2.5", "along = 0.8"))
    assert not world.building_faults and [doorway.name for doorway in world.doorways_of("a")] == ["way"]
    scene = build_scene(list(enumerate(world.faces)), list(enumerate(world.landmarks)))
    assert np.isfinite(scene.planes_world).all() and np.isfinite(scene.edges.lines_world).all()
    lines = [line for mark in world.landmarks if mark.name == "a/east-wall" for line in mark.edges.lines_world]
    assert all(line[:, 2].min() >= height for line in lines), "nothing of the wall is seen where there is none of it"
