"""What people call things and places: a world file says it, and the model has it."""

from __future__ import annotations

from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

PLAIN = """\
name = "house"
units = "metres"
[finishes]
oak = { colour = [0.5, 0.4, 0.3] }
[parts]
chest = [ { x = [-0.3, 0.3], y = [0, 0.4], z = [0, 0.6], finish = "oak" } ]
[locales.hall]
kind = "room"
size = [9, 5]
floor = "oak"
things = [ ["chest", "north", 1, 3, "big"] ]
[doors]
cell = { between = ["hall"], wall = "south", along = 4 }
"""
WORDY = PLAIN.replace("0.3] }", '0.3], words = "planks" }').replace(
    'kind = "room"', 'kind = "room"\nwords = ["big hall", "aula"]').replace(
    '"big"]', '"big", { kind = "trunk", words = "sea chest" }]').replace(
    "along = 4", 'along = 4, kind = "fire exit", words = "way out"')


def read(text: str) -> World:
    return read_world(Source.parse(text, "house.toml"))


def test_what_people_call_things_reaches_the_model_and_changes_nothing_that_is_seen() -> None:
    plain, wordy = read(PLAIN), read(WORDY)
    assert wordy.locale("hall").properties == {
        "words": "big hall, aula, planks",
        "words_of": {"trunk-1": "sea chest", "big": "sea chest", "cell": "fire exit, way out"}}
    assert [thing.kind for thing in wordy.things] == ["trunk", "trunk"] and wordy.named("aula") == ["hall"]
    assert not plain.locale("hall").properties
    assert [f.polygon_world.tolist() for f in wordy.faces] == [f.polygon_world.tolist() for f in plain.faces]
