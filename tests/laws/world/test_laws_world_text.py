"""Laws of reading: whatever the text, a world comes of it or a WorldError that says where; lines are told rightly."""

import re
import tomllib

from hypothesis import given, settings
from hypothesis import strategies as st

from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.toml.source import Source, WorldError, find_line_numbers
from world_models.files.world_files import WORLDS, read_world

SMALL = """\
name = "cottage"
units = "metres"

[finishes]
plain = { colour = [0.5, 0.5, 0.5], texture = "brick", scale = 0.2 }

[defaults]
height = 2.5
baseboard = "plain"

[parts]
box = [ { x = [-0.5, 0.5], y = [0.0, 0.5], z = [0.0, 1.0], finish = "plain", twin = false },
        { x = [-0.5, 0.5], y = [0.0, 0.1], z = [1.0, 2.0], finish = "plain", rim = "plain", rim_width = 0.1 } ]

[locales.ground]
kind = "floor"

[locales.kitchen]
kind = "room"
in = "ground"
size = [4, 3]
things = [ { part = "box", wall = "north", along = 1.0 }, { part = "box", at = [3, 1], turn = 90 } ]

[locales.parlour]
kind = "room"
in = "ground"
at = [4.2, 0]
outline = [[0, 0], [5, 0], [5, 2], [3, 2], [3, 3], [0, 3]]

[doors]
between-them = { between = ["kitchen", "parlour"], wall = "east", along = 1.5, open = true }
pantry = { between = ["kitchen"], wall = "west", along = 1.5 }
"""

TOKENS = re.findall(r"\w+|[^\w\s]|\s+", SMALL)

junk = st.one_of(
    st.sampled_from([*dict.fromkeys(TOKENS)]),
    st.sampled_from(["-1", "0", "1e400", "nan", "inf", "-3.5", "99999999", "true", "[]", "{}", '""', "1979-05-27",
                     "\\"]),
    st.text(max_size=3),
)


@st.composite
def mutated(draw: st.DrawFn) -> str:
    tokens = list(TOKENS)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(tokens) - 1))
        match draw(st.integers(0, 3)):
            case 0:
                tokens[at] = draw(junk)
            case 1:
                del tokens[at]
            case 2:
                tokens.insert(at, draw(junk))
            case _:
                other = draw(st.integers(0, len(tokens) - 1))
                tokens[at], tokens[other] = tokens[other], tokens[at]
    return "".join(tokens)


def read(text: str) -> World | None:
    try:
        world = read_world(Source.parse(text, "cottage.toml"))
    except WorldError as error:
        assert re.match(r"cottage\.toml:\d+: ", str(error)), error
        assert "expected" in str(error) and "got" in str(error)
        return None
    for fault in check_world(world):
        assert re.match(r"cottage\.toml:\d+$", fault.source) and "expected" in fault.what and "got" in fault.what
    return world


def test_the_text_itself_is_a_sound_world() -> None:
    world = read(SMALL)
    assert world is not None and not check_world(world) and len(world.doorways) == 1


@settings(deadline=None, max_examples=250)
@given(mutated())
def test_a_mutated_text_gives_a_world_or_a_world_error(text: str) -> None:
    read(text)


@settings(deadline=None, max_examples=60)
@given(st.text())
def test_any_text_gives_a_world_error(text: str) -> None:
    assert read(text) is None


keys = st.text("ab-", min_size=1, max_size=3)
scalars = st.one_of(st.integers(), st.booleans(), st.sampled_from(['x"y', "a#b", "[", "}", "'", "=,"]))


def as_toml(value: object, draw: st.DrawFn) -> str:
    """A value in TOML's words, with blanks and line ends where they are allowed."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return "'" + value + "'" if "'" not in value and draw(st.booleans()) else '"' + value.replace('"', '\\"') + '"'
    if isinstance(value, list):
        gap = draw(st.sampled_from(["", "\n", " # , ]\n  "]))
        return "[" + "".join(f"{gap}{as_toml(item, draw)}," for item in value) + gap + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"'{key}' = {as_toml(item, draw)}" for key, item in value.items()) + " }"
    return str(value)


@st.composite
def documents(draw: st.DrawFn) -> str:
    values = st.recursive(scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=2))
    lines: list[str] = []
    tables = draw(st.lists(keys, max_size=3, unique=True))
    for header in ("", *tables):
        if header:
            doubled = draw(st.booleans())
            lines.append(f"[[{header}]]" if doubled else f"[ {header} ]")
        for key in draw(st.lists(keys, max_size=3, unique=True)):
            if header or key not in tables:
                lines.append(f'"{key}" = {as_toml(draw(values), draw)} # end')
    return "\n".join(lines)


def walk(value: object, key: tuple[str | int, ...] = ()) -> list[tuple[tuple[str | int, ...], object]]:
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [(key, value)] + [pair for name, item in children for pair in walk(item, (*key, name))]


@settings(deadline=None, max_examples=150)
@given(documents())
def test_every_value_is_found_on_its_line(text: str) -> None:
    data, lines = tomllib.loads(text), find_line_numbers(text)
    rows = text.split("\n")
    for key, value in walk(data)[1:]:
        row = rows[lines[key] - 1]
        if isinstance(value, bool | int):
            assert str(value).lower() in row
        elif isinstance(value, str):
            assert value.replace('"', '\\"') in row or value in row


def test_the_shipped_world_has_a_line_for_every_value() -> None:
    text = (WORLDS / "research_center.toml").read_text()
    data, lines = tomllib.loads(text), find_line_numbers(text)
    assert all(key in lines for key, _ in walk(data)[1:])
    rows = text.split("\n")
    assert rows[lines["locales", "allens-office", "size"] - 1].startswith("allens-office = ")
    assert rows[lines["locales", "hallway", "things", 1] - 1].startswith("  [\"pillar\", \"north\"")
    assert rows[lines["doors", "allens-door"] - 1].startswith("allens-door ")
