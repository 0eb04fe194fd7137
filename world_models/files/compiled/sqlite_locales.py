"""Locale data from a compiled world: one SQLite file, read one locale at a time when first asked for."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from world_models.building.extents import LocaleExtent
from world_models.building.locale_source import LocaleGeometry, PassageEdge
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.memory_locales import words_of
from world_models.building.things import Finding, Thing
from world_models.files.compiled.schema import FORMAT
from world_models.files.compiled.serialization import unpack_array, unpack_geometry
from world_models.files.toml.source import WorldError
from world_models.frames import Pose

T = TypeVar("T")

DOORWAY = "select d.name, la.name, lb.name, thresholds, d.height_m, d.source from doorway d" \
          " join locale la on la.id = d.a join locale lb on lb.id = d.b"
LINK = "select k.name, k.kind, la.name, lb.name, stops, k.source from link k" \
       " join locale la on la.id = k.a join locale lb on lb.id = k.b"
EXTENT = "select l.name, l.id, l.leaf, x0, y0, x1, y1, reach from locale l join bounds b on b.id = l.id"
NEAR = "select l.name from extent e join bounds b on b.id = e.id join locale l on l.id = e.id" \
       " where e.x0 <= ?1 + ?4 and e.x1 >= ?1 - ?4 and e.y0 <= ?2 + ?4 and e.y1 >= ?2 - ?4" \
       " and b.x0 - ?3 <= ?1 and b.x1 + ?3 >= ?1 and b.y0 - ?3 <= ?2 and b.y1 + ?3 >= ?2 order by e.id"
SLACK_M = 1e-6
"""The index is searched this much further, so that rounding leaves nothing out; the exact rectangles decide."""
PACKET = "select la.name, lb.name, words, numbers from packet p" \
         " join locale la on la.id = p.locale left join locale lb on lb.id = p.neighbour"
ARC = "select passage, la.name, a_part, ra.name, lb.name, b_part, rb.name from arc" \
      " join locale la on la.id = a join locale ra on ra.id = a_room" \
      " join locale lb on lb.id = b join locale rb on rb.id = b_room" \
      " where container = (select id from locale where name = ?) order by arc.id"
THING = "select t.name, la.name, t.kind, footprint, low_m, high_m, proud_m, t.source from thing t" \
        " join locale la on la.id = t.locale"


class SqliteLocales:
    """A :class:`world_models.building.locale_source.WorldSource` that reads a compiled world.

    Attributes:
        name: of the world.
        touched: what was loaded so far, as (kind, name of the locale), in order.
    """

    def __init__(self, path: Path, details: Sequence[str] = ()) -> None:
        """Open a compiled world. Raises WorldError where it is none, or was compiled with other details."""
        self._path = path
        self.touched: list[tuple[str, str]] = []
        self._cache: dict[tuple[str, Any], Any] = {}
        try:
            path.stat()
            self._file = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, check_same_thread=False)
            meta = dict(self._file.execute("select key, value from meta"))
        except OSError as error:
            raise WorldError(f"{path}: expected a readable file, got: {error.strerror}") from None
        except (sqlite3.Error, ValueError) as error:
            raise WorldError(f"{path.name}: expected a compiled world, got: {error}") from None
        if meta.get("format") != FORMAT:
            raise WorldError(f"{path.name}: expected {FORMAT!r}, got {meta.get('format')!r}: compile it anew")
        with self._world_errors():
            self.name = str(meta["name"])
            known = json.loads(meta["details"])
            if details and list(details) != known:
                raise WorldError(f"{path.name}: expected the details that it was compiled with "
                                 f"({', '.join(known) or 'none'}), got {', '.join(details)}")
            self._layer = len(details)
            self._counts: Mapping[str, int] = json.loads(meta[f"counts {self._layer}"])

    @contextmanager
    def _world_errors(self) -> Iterator[None]:
        """Turn every error of a broken file into a WorldError."""
        try:
            yield
        except WorldError:
            raise
        except (sqlite3.Error, ValueError, TypeError, LookupError) as error:
            raise WorldError(f"{self._path.name}: expected a sound compiled world, got: {error!r}") from None

    def _rows(self, query: str, *values: Any) -> list[tuple[Any, ...]]:
        return self._file.execute(query, values).fetchall()

    def _load_once(self, kind: str, name: Any, load: Callable[[], T]) -> T:
        """A cached value; loaded, and noted in ``touched``, the first time."""
        key = kind, name
        if key not in self._cache:
            with self._world_errors():
                self._cache[key] = load()
            self.touched.append((kind, str(name)))
        found: T = self._cache[key]
        return found

    # -- locale source -----------------------------------------------------------------------------------------------

    def names(self) -> Sequence[str]:
        return self._names

    @cached_property
    def _names(self) -> tuple[str, ...]:
        with self._world_errors():
            return tuple(str(row[0]) for row in self._rows("select name from locale order by id"))

    def locale(self, name: str) -> Locale | None:
        return self._load_once("locale", name, lambda: self._locale(name))

    def _locale(self, name: str) -> Locale | None:
        rows = self._rows(
            "select l.kind, p.name, l.frame, l.outline, l.height_m, l.floor_m, l.properties, l.source,"
            " l.survey_m, l.survey_rad from locale l"
            " left join locale p on p.id = l.parent where l.name = ?", name)
        if not rows:
            if name in self._names:
                raise WorldError(f"{self._path.name}: expected a sound world, got one whose index lacks {name!r}")
            return None
        kind, parent, frame, outline, height_m, floor_m, properties, source, survey_m, survey_rad = rows[0]
        matrix = unpack_array(frame, (3, 4))
        return Locale(name, kind, parent, Pose(matrix[:, :3], matrix[:, 3]), unpack_array(outline, (-1, 2)),
                      height_m, json.loads(properties), source, floor_m, survey_m, survey_rad)

    def children(self, name: str) -> tuple[str, ...]:
        return self._load_once("children", name, lambda: tuple(row[0] for row in self._rows(
            "select c.name from locale c join locale p on c.parent = p.id where p.name = ? order by c.id", name)))

    def is_room(self, name: str) -> bool:
        return self._load_once("is room", name, lambda: bool(self._rows(
            "select 1 from locale where name = ? and leaf", name)))

    def near(self, x_m: float, y_m: float, margin_m: float, z_m: float | None = None) -> Sequence[str]:
        with self._world_errors():
            return [row[0] for row in self._rows(NEAR, x_m, y_m, margin_m, margin_m + SLACK_M)]

    def number(self, name: str) -> int:
        return self.extent(name).number

    def extent(self, name: str) -> LocaleExtent:
        rows = self._load_once("extent", name, lambda: self._extents("l.name = ?", name))
        if not rows:
            raise ValueError(f"expected a locale of {self.name}, got {name!r}")
        return rows[0]

    def extents_in(self, name: str) -> tuple[LocaleExtent, ...]:
        return self._load_once("extents", name, lambda: self._extents(
            "l.parent = (select id from locale where name = ?) order by l.id", name))

    def _extents(self, where: str, name: str) -> tuple[LocaleExtent, ...]:
        return tuple(_build_extent(row) for row in self._rows(f"{EXTENT} where {where}", name))

    def doorways(self, locale: str) -> tuple[Doorway, ...]:
        return self._load_once("doorways", locale, lambda: tuple(_build_doorway(row) for row in self._rows(
            f"{DOORWAY} where d.a = (select id from locale where name = ?1)"
            " or d.b = (select id from locale where name = ?1) order by d.id", locale)))

    def links(self, locale: str) -> tuple[Link, ...]:
        return self._load_once("links", locale, lambda: tuple(_build_link(row) for row in self._rows(
            f"{LINK} where k.a = (select id from locale where name = ?1)"
            " or k.b = (select id from locale where name = ?1) order by k.id", locale)))

    def geometry(self, locale: str) -> tuple[LocaleGeometry, ...]:
        return self._load_once("faces", locale, lambda: self._geometry(
            f"{PACKET} where (p.locale = (select id from locale where name = ?1)"
            " or p.neighbour = (select id from locale where name = ?1)) and layer <= ?2 order by p.id",
            locale, self._layer))

    def _geometry(self, query: str, *values: Any) -> tuple[LocaleGeometry, ...]:
        rows: dict[tuple[str, str | None], list[tuple[str, bytes]]] = {}
        for locale, neighbour, words, numbers in self._rows(query, *values):
            rows.setdefault((locale, neighbour), []).append((words, numbers))
        return tuple(unpack_geometry(*key, several) for key, several in rows.items())

    def things(self, locale: str) -> tuple[Thing, ...]:
        return self._load_once("things", locale, lambda: tuple(_build_thing(row) for row in self._rows(
            f"{THING} where t.locale = (select id from locale where name = ?) and layer <= ? order by t.id",
            locale, self._layer)))

    def passage_edges(self, container: str) -> tuple[PassageEdge, ...]:
        return self._load_once("passages", container, lambda: tuple(
            PassageEdge(passage, ((a, a_part), (b, b_part)), (a_room, b_room))
            for passage, a, a_part, a_room, b, b_part, b_room in self._rows(ARC, container)))

    def components(self, locale: str) -> tuple[int, ...]:
        return self._load_once("components", locale, lambda: tuple(int(row[0]) for row in self._rows(
            "select above from component where locale = (select id from locale where name = ?) order by number",
            locale)))

    def passage(self, name: str) -> Doorway | Link | None:
        def load() -> Doorway | Link | None:
            rows = self._rows(f"{DOORWAY} where d.name = ?", name)
            links = self._rows(f"{LINK} where k.name = ?", name) if not rows else []
            return _build_doorway(rows[0]) if rows else _build_link(links[0]) if links else None

        return self._load_once("passage", name, load)

    def named(self, words: str) -> Sequence[str]:
        wanted = sorted(words_of(words))
        if not wanted:
            return []
        with self._world_errors():
            marks = ", ".join("?" * len(wanted))
            return [row[0] for row in self._rows(
                f"select l.name from locale l join word w on w.locale = l.id where word in ({marks})"
                " group by l.id having count(*) = ? order by l.id", *wanted, len(wanted))]

    def all_doorways(self) -> tuple[Doorway, ...]:
        with self._world_errors():
            return tuple(_build_doorway(row) for row in self._rows(f"{DOORWAY} order by d.id"))

    def all_links(self) -> tuple[Link, ...]:
        with self._world_errors():
            return tuple(_build_link(row) for row in self._rows(f"{LINK} order by k.id"))

    def all_geometry(self) -> tuple[LocaleGeometry, ...]:
        with self._world_errors():
            return self._geometry(f"{PACKET} where layer <= ? order by p.id", self._layer)

    def all_things(self) -> tuple[Thing, ...]:
        with self._world_errors():
            rows = self._rows(f"{THING} where layer <= ? order by t.id", self._layer)
            return tuple(_build_thing(row) for row in rows)

    def counts(self) -> Mapping[str, int]:
        return self._counts

    def last_room(self) -> str:
        """Name of the room that was written last."""
        with self._world_errors():
            return str(self._rows("select name from locale where leaf order by id desc limit 1")[0][0])

    @property
    def sha256(self) -> str:
        """Digest of the contents; stored in the file, so that a large one need not be read for it."""
        with self._world_errors():
            return str(self._rows("select value from meta where key = 'sha256'")[0][0])

    def faults(self) -> tuple[Finding, ...]:
        with self._world_errors():
            return tuple(Finding(source, what) for source, what in self._rows("select source, what from fault"))


def _build_extent(row: tuple[Any, ...]) -> LocaleExtent:
    name, number, is_room, x0, y0, x1, y1, reach = row
    low_x, low_y, low_z, high_x, high_y, high_z = unpack_array(reach, (6,)).tolist()
    return LocaleExtent(name, number, bool(is_room), (x0, y0, x1, y1), (low_x, low_y, low_z, high_x, high_y, high_z))


def _build_doorway(row: tuple[Any, ...]) -> Doorway:
    name, a, b, thresholds, height_m, source = row
    return Doorway(name, (a, b), unpack_array(thresholds, (2, 2, 2)), height_m, source)


def _build_link(row: tuple[Any, ...]) -> Link:
    name, kind, a, b, stops, source = row
    return Link(name, kind, (a, b), unpack_array(stops, (2, 3)), source)


def _build_thing(row: tuple[Any, ...]) -> Thing:
    name, locale, kind, footprint, low_m, high_m, proud_m, source = row
    return Thing(name, locale, kind, unpack_array(footprint, (-1, 2)), low_m, high_m, proud_m, source)
