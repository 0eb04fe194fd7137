"""``harvey experiment instructions``: routes told by a generator, and paragraphs of many styles, read on buildings."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib.resources import files
from itertools import islice
from pathlib import Path

import numpy as np

from experiments.generated.floors import generated_floor
from experiments.report import Cell, Report
from harvey_words.directions.directions import write_directions
from harvey_words.experiments.told_routes import Hall, Node, Told, draw_maze, tell_maze, tell_rooms, write_maze
from harvey_words.following.reading import RouteError, read_route
from harvey_words.following.word_map import WordMap
from harvey_words.reading.lexicon import split_text
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world

ROUTES, QUICK_ROUTES = 300, 30
KINDS = ("research centre", "generated floors", "mazes")
TOLD_ON_ONE = 10
"""Routes on one building before another is drawn."""
PARAGRAPHS = Path(str(files("harvey_words"))).parent / "tests" / "data" / "paragraphs.txt"
OTHERS = {"of development": PARAGRAPHS.with_name("development.txt"),
          "fresh, then of development": PARAGRAPHS.with_name("fresh.txt"),
          "blind, then of development": PARAGRAPHS.with_name("blind.txt")}
COLUMNS = ("what", "texts", "arrive", "ask, the right place first", "ask, another first", "silently elsewhere",
           "ms a sentence")
HOW = ("takes right", "asks right", "asks another", "takes another")
"""How a text is read: by whether it is understood, and whether the likeliest end is the right one."""
LEAST = {"routes": (0.95, 0.01), "paragraphs": (0.85, 0.02), "directions": (0.99, 0.01)}
"""Least share that arrives, and greatest that is elsewhere without a question."""


def draw_plans(kind: str, rng: np.random.Generator) -> Iterator[tuple[WordMap, tuple[Hall, ...], dict[Node, str]]]:
    """Buildings of a kind without end, each for so many routes; of a maze its halls and things too."""
    plan = WordMap(load_world(WORLDS / "research_center.toml"))
    while True:
        halls, things = draw_maze(rng) if kind == "mazes" else ((), {})
        if kind == "generated floors":
            plan = WordMap(generated_floor(int(rng.integers(10**6)), 10, open_share=0.8).world)
        elif kind == "mazes":
            plan = WordMap(read_world(Source.parse(write_maze(halls, things), "maze")))
        yield from ((plan, halls, things) for _ in range(TOLD_ON_ONE))


def draw_routes(count: int, seed: int) -> Iterator[tuple[str, WordMap, Told]]:
    """Routes on the research centre, on generated floors and in mazes, a third each."""
    rng = np.random.default_rng([seed, 62])
    for kind in KINDS:
        drawn = ((plan, tell_maze(halls, things, rng) if halls else tell_rooms(plan, rng))
                 for plan, halls, things in draw_plans(kind, rng))
        told = ((kind, plan, route) for plan, route in drawn if route is not None)
        yield from islice(told, count // 3)


def draw_directions(count: int, seed: int) -> Iterator[tuple[str, WordMap, Told]]:
    """Directions written between rooms and crossings that are drawn on the same kinds of buildings."""
    rng = np.random.default_rng([seed, 63])
    for kind in KINDS:
        drawn = ((kind, plan, _direct(plan, bool(halls), rng)) for plan, halls, _ in draw_plans(kind, rng))
        yield from islice(((kind, plan, told) for kind, plan, told in drawn if told is not None), count // 3)


def _direct(plan: WordMap, is_maze: bool, rng: np.random.Generator) -> Told | None:
    places = [name for name, area in sorted(plan.areas.items()) if area.is_hall == area.is_tile == is_maze]
    start, end = (str(place) for place in rng.choice(places, 2, replace=False))
    try:
        return Told(start, end, write_directions(plan, start, end).text)
    except RouteError:
        return None  # a room whose door is shut


def read_paragraphs(path: Path = PARAGRAPHS) -> Iterator[tuple[str, WordMap, str, float | None, str, str]]:
    """The style, map, start, heading [degrees], end and text of each."""
    plans: dict[str, WordMap] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line or line.startswith("#"):
            continue
        name, start, heading, end, style, text = (part.strip() for part in line.split("|", 5))
        if name not in plans:
            beside = path.with_name(f"{name}.toml")
            plans[name] = WordMap(load_world(
                beside if beside.exists() else WORLDS / f"{name.replace('-', '_')}.toml"))
        yield style, plans[name], start, None if heading == "-" else float(heading), end, text


def run(quick: bool, seed: int) -> Report:
    """Read routes, paragraphs and directions."""
    ends: dict[str, Counter[str]] = {what: Counter() for what in (*LEAST, *OTHERS)}

    def read(what: Sequence[str], text: str, plan: WordMap, start: str, heading: float | None, end: str) -> None:
        begin = time.perf_counter()
        reading = read_route(text, plan, start, heading)
        taken = time.perf_counter() - begin
        right = "right" if reading.end is not None and reading.end.is_at(end) else "another"
        for name in what:
            ends.setdefault(name, Counter()).update({
                f"{'takes' if reading.is_understood else 'asks'} {right}": 1, "ms": 1000.0 * taken,
                "sentences": max(1, split_text(text).count("."))})

    count = QUICK_ROUTES if quick else ROUTES
    for kind, plan, told in draw_routes(count, seed):
        read(("routes", f"routes: {kind}"), told.text, plan, told.start, None, told.end)
    for name, path in (("paragraphs", PARAGRAPHS), *OTHERS.items()):
        for style, plan, start, heading, end, text in read_paragraphs(path) if path.exists() else ():
            read((name, f"paragraphs: {style}") if path is PARAGRAPHS else (name,), text, plan, start, heading, end)
    for _, plan, told in draw_directions(count, seed):
        read(("directions",), told.text, plan, told.start, None, told.end)
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (what, sum(n[how] for how in HOW), *(n[how] for how in HOW), n["ms"] / max(n["sentences"], 1))
        for what, n in ends.items())
    claims = tuple(
        (f"{what}: at least {least:.0%} arrive, at most {silent:.0%} silently elsewhere",
         ends[what][HOW[0]] >= least * texts and ends[what][HOW[-1]] <= silent * texts)
        for what, (least, silent) in LEAST.items() for texts in (sum(ends[what][how] for how in HOW),))
    return Report("Ways that are told in words", COLUMNS, rows, NOTES, claims)


NOTES = (
    "Routes: told by a generator with its own wording, from a room to a door of its hall in the research centre and on"
    " generated floors, and from crossing to crossing in drawn mazes; nobody says which way the body faces.",
    "Paragraphs: written down before the grammar, in differing styles; an installed package has none. Those of"
    " development are others, of other mazes: the reader is bettered by them, so they claim nothing.",
    "Directions: written from room to room, and from crossing to crossing, and read again from the same start.",
)
