"""``harvey experiment instructions``: routes told by a generator, and paragraphs of many styles, read on buildings."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from experiments.generated.floors import generated_floor
from experiments.report import Cell, Report
from harvey_words.directions import write_directions
from harvey_words.experiments.mazes import write_maze
from harvey_words.experiments.told_routes import Told, draw_maze, tell_maze, tell_rooms
from harvey_words.lexicon import split_text
from harvey_words.reading import Reading, RouteError, read_route
from harvey_words.word_map import WordMap
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world

ROUTES, QUICK_ROUTES = 300, 30
TOLD_ON_ONE = 10
"""Routes on one building before another is drawn."""
PARAGRAPHS = Path(str(files("harvey_words"))).parent / "tests" / "data" / "paragraphs.txt"
DEVELOPMENT = PARAGRAPHS.with_name("development.txt")
COLUMNS = ("what", "texts", "arrive", "ask, the right place first", "ask, another first", "silently elsewhere",
           "ms a sentence")
LEAST = {"routes": (0.95, 0.01), "paragraphs": (0.85, 0.02), "directions": (0.99, 0.01)}
"""Least share that arrives, and greatest that is elsewhere without a question."""


@dataclass
class Tally:
    """How texts were read: those that arrive, ask with the right place first or another, or are silently elsewhere."""

    arrive: int = 0
    near: int = 0
    ask: int = 0
    elsewhere: int = 0
    seconds: float = 0.0
    sentences: int = 0

    @property
    def count(self) -> int:
        return self.arrive + self.near + self.ask + self.elsewhere

    def add(self, reading: Reading, end: str, seconds: float) -> None:
        """Count one text."""
        right = reading.end is not None and reading.end.is_at(end)
        if reading.is_understood:
            self.arrive += right
            self.elsewhere += not right
        else:
            self.near += right
            self.ask += not right
        self.seconds += seconds
        self.sentences += max(1, split_text(reading.text).count("."))

    def row(self, what: str) -> tuple[Cell, ...]:
        """Of the table."""
        return (what, self.count, self.arrive, self.near, self.ask, self.elsewhere,
                1000.0 * self.seconds / max(self.sentences, 1))

    def reaches(self, least: float, most_silent: float) -> bool:
        """Whether enough arrive, and few enough are silently elsewhere."""
        return self.arrive >= least * self.count and self.elsewhere <= most_silent * self.count


def draw_routes(count: int, seed: int) -> Iterator[tuple[str, WordMap, Told]]:
    """Routes on the research centre, on generated floors and in mazes, a third each."""
    rng = np.random.default_rng([seed, 62])
    centre = WordMap(load_world(WORLDS / "research_center.toml"))
    for kind in ("research centre", "generated floors", "mazes"):
        told = 0
        while told < count // 3:
            plan = centre if kind == "research centre" else None
            if kind == "generated floors":
                plan = WordMap(generated_floor(int(rng.integers(10**6)), 10, open_share=0.8).world)
            halls, things = draw_maze(rng) if plan is None else ((), {})
            plan = plan or WordMap(read_world(Source.parse(write_maze(halls, things), "maze")))
            for _ in range(TOLD_ON_ONE):
                route = tell_maze(halls, things, rng) if halls else tell_rooms(plan, rng)
                if route is not None and told < count // 3:
                    told += 1
                    yield kind, plan, route


def draw_directions(count: int, seed: int) -> Iterator[tuple[WordMap, Told]]:
    """Directions written between rooms and crossings that are drawn on the same kinds of buildings."""
    rng = np.random.default_rng([seed, 63])
    centre = WordMap(load_world(WORLDS / "research_center.toml"))
    for kind in ("research centre", "generated floors", "mazes"):
        written = 0
        while written < count // 3:
            if kind == "generated floors":
                plan = WordMap(generated_floor(int(rng.integers(10**6)), 10, open_share=0.8).world)
            else:
                plan = centre if kind == "research centre" else WordMap(
                    read_world(Source.parse(write_maze(*draw_maze(rng)), "maze")))
            places = [name for name, area in sorted(plan.areas.items()) if area.is_hall == (kind == "mazes")
                      and area.is_tile == area.is_hall]
            for _ in range(min(TOLD_ON_ONE, count // 3 - written)):
                start, end = rng.choice(places, 2, replace=False)
                try:
                    text = write_directions(plan, str(start), str(end)).text
                except RouteError:
                    continue  # a room whose door is shut
                written += 1
                yield plan, Told(str(start), str(end), text)


def read_paragraphs(path: Path = PARAGRAPHS) -> Iterator[tuple[str, WordMap, str, float | None, str, str]]:
    """The style, map, start, heading [degrees], end and text of each."""
    plans: dict[str, WordMap] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line or line.startswith("#"):
            continue
        name, start, heading, end, style, text = (part.strip() for part in line.split("|", 5))
        if name not in plans:
            beside = path.with_name(f"{name}.toml")
            world = (read_world(Source.parse(write_maze(), name)) if name == "maze" else load_world(
                beside if beside.exists() else WORLDS / f"{name.replace('-', '_')}.toml"))
            plans[name] = WordMap(world)
        yield style, plans[name], start, None if heading == "-" else float(heading), end, text


def run(quick: bool, seed: int) -> Report:
    """Read routes, paragraphs and directions."""
    tallies = {what: Tally() for what in (*LEAST, "of development")}

    def read(what: Sequence[str], text: str, plan: WordMap, start: str, heading: float | None, end: str) -> None:
        begin = time.perf_counter()
        reading = read_route(text, plan, start, heading)
        taken = time.perf_counter() - begin
        for name in what:
            tallies.setdefault(name, Tally()).add(reading, end, taken)

    count = QUICK_ROUTES if quick else ROUTES
    for kind, plan, told in draw_routes(count, seed):
        read(("routes", f"routes: {kind}"), told.text, plan, told.start, None, told.end)
    for path in (PARAGRAPHS, DEVELOPMENT):
        for style, plan, start, heading, end, text in read_paragraphs(path) if path.exists() else ():
            what = ("paragraphs", f"paragraphs: {style}") if path is PARAGRAPHS else ("of development",)
            read(what, text, plan, start, heading, end)
    for plan, told in draw_directions(count, seed):
        read(("directions",), told.text, plan, told.start, None, told.end)
    rows = tuple(tally.row(what) for what, tally in tallies.items())
    claims = tuple(
        (f"{what}: at least {least:.0%} arrive, at most {silent:.0%} silently elsewhere",
         tallies[what].reaches(least, silent)) for what, (least, silent) in LEAST.items())
    return Report("Ways that are told in words", COLUMNS, rows, NOTES, claims)


NOTES = (
    "Routes: told by a generator with its own wording, from a room to a door of its hall in the research centre and on"
    " generated floors, and from crossing to crossing in drawn mazes; nobody says which way the body faces.",
    "Paragraphs: written down before the grammar, in differing styles; an installed package has none. Those of"
    " development are others, of other mazes: the reader is bettered by them, so they claim nothing.",
    "Directions: written from room to room, and from crossing to crossing, and read again from the same start.",
)
