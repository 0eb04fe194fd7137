"""The reference of world files: the keys that the reader knows, each with what it is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from docs.tools.site.markdown import table
from world_models.files.toml.locale_reader import DEFAULT_KEYS, LOCALE_KEYS
from world_models.files.toml.other_files import COPY_KEYS
from world_models.files.toml.placements import ROW_KEYS, THING_KEYS
from world_models.files.toml.world_reader import DOOR_KEYS, SHARED_KEYS

TOP: Mapping[str, str] = {
    "include": "other files (finishes, parts, defaults) that are read first; this file's own defaults win",
    "finishes": "colours and textures, by name",
    "parts": "things made of boxes, by name",
    "defaults": "what holds for every locale and door that does not say otherwise",
}
DEFAULTS: Mapping[str, str] = {
    "walls": "finish of the walls; in a locale also a list or a table with one for each wall",
    "floor": "finish of the floor",
    "ceiling": "finish of the ceiling",
    "baseboard": 'finish of the baseboards, or `"none"`',
    "moulding": 'finish of the moulding under the ceiling, or `"none"`',
    "frame": "finish of door frames, or `\"none\"`: plain openings in the wall",
    "leaf": "finish of closed doors",
    "threshold": "finish of the floor in doorways",
    "kind": "of locales: a word of your own, as `room`",
    "in": "the locale in which locales lie; by default the whole world",
    "height": "of rooms; 2.7 m where nothing is said",
    "door_width": "0.9 m where nothing is said",
    "door_height": "2 m where nothing is said",
}
LOCALES: Mapping[str, str] = {
    "kind": "a word of your own, as `room`; must be given here or in the defaults",
    "in": "the locale in which it lies; by default the whole world",
    "at": "`[x, y]` or `[x, y, z]`: its origin in the frame of the locale in which it lies",
    "turn": "degrees, counter-clockwise, about its origin",
    "size": "`[x, y]` of a rectangle whose corner is the origin; its walls are south, east, north and west",
    "outline": "instead of a size: corners counter-clockwise; its walls are `side-0`, `side-1` and so on",
    "height": "of its walls",
    "wall_heights": "a table: walls that are lower than the locale",
    "sky": "true: no ceiling",
    "like": "another locale of this file, whose keys hold here unless given again",
    "things": "a list of things; see below",
    "properties": "texts, numbers and flags of your own",
    "survey": "`{ sigma = ..., sigma_deg = ... }`: how well its frame's place and direction are known",
    "sigma_cm": "how well its walls, doors and things are known; standard deviation in centimetres",
    "words": "what people call it: a text, or several; those of its finishes are added",
    **{key: DEFAULTS[key] for key in ("walls", "floor", "ceiling", "baseboard", "moulding")},
}
COPIES: Mapping[str, str] = {
    "from": "a world file",
    "of": "the locale of that file which is copied, with all that lies in it; by default all",
    "prefix": "put before the names of the copies",
    "without": "names of locales, doors and things that are left out",
    "kind": "instead of its own",
    "in": LOCALES["in"],
    "at": LOCALES["at"],
    "turn": LOCALES["turn"],
    "properties": "added to its own",
    "add": "a table of rooms of the copy (by their old names), each with a list of things that are added",
}
DOORS: Mapping[str, str] = {
    "width": "of the opening; else the defaults' `door_width`",
    "height": "of the opening; else the defaults' `door_height`",
    "open": "true: one can drive through; needs two locales",
    "frame": DEFAULTS["frame"],
    "leaf": DEFAULTS["leaf"],
    "threshold": DEFAULTS["threshold"],
    "panel": "a part that is mounted on the closed leaf",
    "sigma_cm": "how well its place is known; standard deviation in centimetres",
    "kind": "what it is, in a word of your own, as `fire exit`",
    "words": "what people call it: a text, or several",
}
THINGS: Mapping[str, str] = {
    "part": "the part of which it is made, or instead of it",
    "boxes": "a list of boxes",
    "finish": "instead of the finishes of the part's boxes",
    "name": "else the part's name and a number",
    "wall": "the wall on which it hangs, with `along` and `up`",
    "along": "the place on the wall: the locale's x on south and north, its y on east and west; "
             "on the walls of an outline the distance from the wall's start",
    "up": "above the floor",
    "at": "instead of a wall: `[x, y]` on the floor, in the locale's frame, with `turn`",
    "turn": "degrees, counter-clockwise",
    "sigma_cm": DOORS["sigma_cm"],
    "kind": "what it is, in a word of your own; else the part's name",
    "words": DOORS["words"],
}
TABLES: Mapping[str, tuple[Iterable[str], Mapping[str, str]]] = {
    "Shared by files": (SHARED_KEYS, TOP),
    "`[defaults]`": (DEFAULT_KEYS, DEFAULTS),
    "`[locales.NAME]`": (LOCALE_KEYS, LOCALES),
    "`[locales.NAME]`, copied from another file": (COPY_KEYS, COPIES),
    "`[doors]`": (DOOR_KEYS, DOORS),
    "Things, as tables": (THING_KEYS, THINGS),
    "The table at the end of a row of things": (ROW_KEYS, {key: THINGS[key] for key in ROW_KEYS}),
}
"""What the reader knows, and what is said of it here."""


def describe_world_keys() -> str:
    """A table for each kind of table. Raises ValueError where the reader knows other keys than are described."""
    lines = []
    for title, (known, described) in TABLES.items():
        if unlike := sorted(set(known) ^ set(described)):
            raise ValueError(f"{title}: expected the reader and the reference to have the same keys, got only in one "
                             f"of them: {', '.join(unlike)}")
        lines += [f"### {title}", *table(("key", "meaning"), [
            (f"`{key}`", what) for key, what in described.items()])]
    return "\n".join(lines)
