"""Compiling a world into one SQLite file, from which locale data are read one locale at a time."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from world_models.building.extents import Box, bounding_box, bounding_rectangle, compute_reaches
from world_models.building.locale_source import LocaleGeometry
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.memory_locales import words_about
from world_models.building.passages import build_passage_graphs, drivable_passages
from world_models.building.things import Finding, Thing
from world_models.building.world import World
from world_models.files.compiled.schema import FORMAT, INDICES, SCHEMA
from world_models.files.compiled.serialization import pack_array, pack_geometry
from world_models.files.toml.source import WorldError
from world_models.frames import Pose


def compile_world(layers: Sequence[World], out: Path, details: Sequence[str] = ()) -> None:
    """Write a world to a compiled file.

    Args:
        layers: the world as the robot knows it, then with each file of details added.
        out: the file; replaced.
        details: names of the files of details, in that order.

    Raises:
        WorldError: the file cannot be written.
    """
    partial = out.with_name(out.name + ".partial")
    try:
        partial.unlink(missing_ok=True)
        with closing(sqlite3.connect(partial)) as file:
            writer = WorldWriter(file, layers[0].name, details)
            _write(writer, layers)
        os.replace(partial, out)
    except (OSError, sqlite3.Error) as error:
        raise WorldError(f"{out}: expected a file that a world can be compiled to, got: {error}") from None
    finally:
        partial.unlink(missing_ok=True)


def _write(writer: WorldWriter, layers: Sequence[World]) -> None:
    world = layers[-1]
    numbers = {name: number for number, name in enumerate(world.locale_source.names())}
    for name in dict.fromkeys(step for each in numbers for step in world.path_of(each)):
        writer.add_locale(world.locale(name), numbers[name])
    for doorway in world.doorways:
        writer.add_doorway(doorway)
    for link in world.links:
        writer.add_link(link)
    known = 0, 0, 0
    for layer, built in enumerate(layers):
        for geometry in built.locale_source.all_geometry():
            writer.add_geometry(_new_in_layer(geometry, known[0], known[1]), layer)
        for thing in built.things[known[2] :]:
            writer.add_thing(thing, layer)
        counts = built.counts()
        writer.count(layer, counts)
        known = counts["face"], counts["landmark"], counts["thing"]
    writer.finish(layers[-1].building_faults)


def _new_in_layer(geometry: LocaleGeometry, faces: int, landmarks: int) -> LocaleGeometry:
    """The faces and landmarks that are not in an earlier layer."""
    return LocaleGeometry(
        geometry.locale, geometry.neighbour, tuple(pair for pair in geometry.faces if pair[0] >= faces),
        tuple(pair for pair in geometry.landmarks if pair[0] >= landmarks))


class WorldWriter:
    """Writes locale data as they come; containers before what they contain."""

    def __init__(self, file: sqlite3.Connection, name: str, details: Sequence[str] = ()) -> None:
        self._file = file
        self._ids: dict[str, int] = {}
        self._parents: dict[str, str | None] = {}
        self._poses: dict[str, Pose] = {}
        self._boxes: dict[str, Box] = {}
        self._passages: list[tuple[str, str, str]] = []
        self._words: list[tuple[str, int]] = []
        self._digest = hashlib.sha256()
        file.executescript("pragma journal_mode = off; pragma synchronous = off; pragma page_size = 4096;" + SCHEMA)
        self._meta("format", FORMAT)
        self._meta("name", name)
        self._meta("details", json.dumps(list(details)))

    def _insert(self, statement: str, row: tuple[Any, ...]) -> None:
        self._digest.update(repr(row).encode())
        self._file.execute(statement, row)

    def _meta(self, key: str, value: str) -> None:
        self._file.execute("insert into meta values (?, ?)", (key, value))

    def add_locale(self, locale: Locale, number: int | None = None) -> None:
        """Add a locale; its container must have been added before.

        Args:
            locale: the locale.
            number: its place in the order of the world's file; by default the order in which locales are added.
        """
        number = self._ids[locale.name] = len(self._ids) if number is None else number
        parent = locale.parent
        pose = locale.frame if parent is None else self._poses[parent] @ locale.frame
        self._poses[locale.name], self._parents[locale.name] = pose, parent
        self._boxes[locale.name] = bounding_box(locale, pose)
        frame = pack_array(np.column_stack([locale.frame.rotation, locale.frame.translation]))
        self._insert("insert into locale values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 1)", (
            number, locale.name, locale.kind, None if parent is None else self._ids[parent], frame,
            pack_array(locale.outline), locale.height_m, locale.floor_m, json.dumps(dict(locale.properties)),
            locale.survey_m, locale.survey_rad, locale.source))
        self._words += [(word, number) for word in sorted(words_about(locale))]

    def add_doorway(self, doorway: Doorway) -> None:
        """Add an open doorway between locales that were added before."""
        a, b = (self._ids[name] for name in doorway.between)
        self._passages += drivable_passages([doorway])
        self._insert("insert into doorway (name, a, b, thresholds, height_m, source) values (?, ?, ?, ?, ?, ?)", (
            doorway.name, a, b, pack_array(doorway.thresholds_world), doorway.height_m, doorway.source))

    def add_link(self, link: Link) -> None:
        """Add an elevator or a flight of stairs between locales that were added before."""
        a, b = (self._ids[name] for name in link.between)
        self._passages += drivable_passages([link])
        self._insert("insert into link (name, kind, a, b, stops, source) values (?, ?, ?, ?, ?, ?)", (
            link.name, link.kind, a, b, pack_array(link.stops_world), link.source))

    def add_geometry(self, geometry: LocaleGeometry, layer: int = 0) -> None:
        """Add faces and landmarks; empty geometry is left out."""
        if geometry.faces or geometry.landmarks:
            self.add_packed_geometry(geometry.locale, geometry.neighbour, *pack_geometry(geometry), layer)

    def add_packed_geometry(
        self, locale: str, neighbour: str | None, words: str, numbers: bytes, layer: int = 0
    ) -> None:
        """Add geometry that is packed already."""
        self._insert("insert into packet (locale, neighbour, layer, words, numbers) values (?, ?, ?, ?, ?)", (
            self._ids[locale], None if neighbour is None else self._ids.get(neighbour), layer, words, numbers))

    def add_thing(self, thing: Thing, layer: int = 0) -> None:
        self._insert(
            "insert into thing (locale, layer, name, kind, footprint, low_m, high_m, proud_m, source)"
            " values (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (self._ids[thing.locale], layer, thing.name, thing.kind, pack_array(thing.footprint_world), thing.low_m,
             thing.high_m, thing.protrusion_m, thing.source))

    def count(self, layer: int, counts: object) -> None:
        """Store the numbers of rooms, doorways and so on, with layers up to this one."""
        self._meta(f"counts {layer}", json.dumps(counts))

    def finish(self, faults: Iterable[Finding] = ()) -> None:
        """Build the passage graphs, index everything and commit."""
        ids = self._ids
        graphs = build_passage_graphs({name: self._parents[name] for name in sorted(ids, key=ids.__getitem__)},
                                      self._passages)
        edges = [(ids[container], edge.passage, ids[a], a_part, ids[edge.rooms[0]], ids[b], b_part, ids[edge.rooms[1]])
                 for container, several in graphs.edges.items() for edge in several
                 for (a, a_part), (b, b_part) in [edge.between]]
        self._file.executemany("insert into arc (container, passage, a, a_part, a_room, b, b_part, b_room)"
                               " values (?, ?, ?, ?, ?, ?, ?, ?)", edges)
        self._file.executemany("insert into component values (?, ?, ?)",
                               ((ids[name], part, above) for name, several in graphs.components.items()
                                for part, above in enumerate(several)))
        rectangles = ((ids[name], *bounding_rectangle(box)) for name, box in self._boxes.items())
        self._file.executemany("insert into extent (id, x0, y0, x1, y1) values (?, ?, ?, ?, ?)", rectangles)
        reaches = compute_reaches(self._parents, self._boxes)
        self._file.executemany("insert into bounds values (?, ?, ?, ?, ?, ?)", (
            (ids[name], *bounding_rectangle(box), pack_array(reaches[name])) for name, box in self._boxes.items()))
        self._file.executemany("insert into word values (?, ?)", self._words)
        self._meta("sha256", self._digest.hexdigest())
        self._file.executemany("insert into fault values (?, ?)", ((fault.source, fault.what) for fault in faults))
        self._file.execute("update locale set leaf = 0 where id in (select parent from locale)")
        self._file.commit()
        self._file.executescript(INDICES)
