"""The report of a run: story, replay and plots in one HTML file that asks the network for nothing."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from html import escape
from importlib.resources import files
from typing import Any

from harvey.errors import BadInput
from harvey.report import data
from harvey.report.data import draw_plans, read_pictures
from harvey.report.drawing import draw_errors
from logs.explain.story import RunStory, run_name, tell_run
from logs.explain.true_errors import read_errors
from logs.pictures import open_pictures
from logs.reader import read_true_track
from logs.run_directory import RunDirectory
from logs.run_head import SIMULATOR, RunHead
from logs.timeline import Timeline
from world_models.building.world import World
from world_models.camera import Camera


def build_page(run: RunDirectory, history: Timeline) -> str:
    """The whole file.

    Raises:
        BadInput, RecordingError: journal, pictures, result or recording cannot be read.
    """
    story = tell_run(run, history)
    world, camera, is_simulated = find_known(run)
    track = read_true_track(run.recording) if is_simulated and world is not None else []
    errors = read_errors(run, history) if track else ()
    beliefs = list(data.beliefs(history, world))
    plans = [] if world is None else draw_plans(world, beliefs, track)
    contents = {
        "cycles": list(data.cycles(history)), "entries": data.entries(history), "beliefs": beliefs,
        "candidates": list(data.candidates(history, world)), "track": track,
        "errors": [asdict(error) for error in errors],
        "plans": [{key: value for key, value in plan.items() if key != "svg"} for plan in plans],
        "pictures": list(read_pictures(history, open_pictures(run), camera)),
        "turns": [asdict(point) for point in story.turning_points if point.is_main],
    }
    title = run_name(run)
    parts = {
        "title": escape(title), "style": read_part("page.css"), "script": read_part("draw.js") + read_part("page.js"),
        "data": packed(contents),
        "opening": _opening(story), "plans": "\n".join(plan["svg"] for plan in plans),
        "errors": draw_errors(beliefs, errors, lost_spans(story, history)) if beliefs else "",
        "sections": "\n".join(_sections(story)), "milestones": "\n".join(_milestones(story)),
        "last": str(history.cycles[-1]),
    }
    return fill_in(read_part("page.html"), parts)


def fill_in(frame: str, parts: Mapping[str, str]) -> str:
    """The frame with each ``{{name}}`` replaced once; what is put in is not looked at again."""
    pieces = frame.split("{{")
    found = [pieces[0]]
    for piece in pieces[1:]:
        name, _, rest = piece.partition("}}")
        found += [parts[name], rest]
    return "".join(found)


def embedded(contents: Any) -> str:
    """JSON that can stand in a script element: no text of it ends that, or begins a comment."""
    text = json.dumps(contents, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def packed(contents: Any) -> str:
    """JSON as gzip in base 64, which the page unpacks: sentences and lines take an eighth of their size."""
    text = json.dumps(contents, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")


def lost_spans(story: RunStory, history: Timeline) -> Iterator[tuple[int, int]]:
    """From each cycle in which it was lost to that in which it was found, or to the end."""
    since: int | None = None
    for point in story.turning_points:
        if point.kind == "lost" and since is None:
            since = point.cycle
        elif point.kind == "found" and since is not None:
            yield since, point.cycle
            since = None
    if since is not None:
        yield since, history.cycles[-1]


def find_known(run: RunDirectory) -> tuple[World | None, Camera | None, bool]:
    """World and camera of the run, where its files are as they were; and whether the truth is recorded."""
    try:
        head = RunHead.read(run.path)
        world = head.load_world()
        return world, head.model(world).lens, head.kind == SIMULATOR and run.recording.is_file()
    except BadInput:
        return None, None, False


def read_part(name: str) -> str:
    """A part of the page, from its file next to this one."""
    return (files("harvey.report") / name).read_text(encoding="utf-8")


def _opening(story: RunStory) -> str:
    """The first lines, which wrap on a narrow screen: what stands indented is a list."""
    first, *rest = story.opening
    items = "".join(f"<li>{escape(' '.join(line.split()))}</li>" for line in rest if line.startswith(" "))
    plain = "".join(f"<p>{escape(line)}</p>" for line in rest if line.strip() and not line.startswith(" "))
    return f"<p><strong>{escape(first)}</strong></p>\n{plain}<ul>{items}</ul>"


def _sections(story: RunStory) -> Iterator[str]:
    for section in story.sections:
        yield f"<h3>{escape(section.headline)}</h3>\n<table>"
        for one in section.steps:
            time = "" if one.time_s is None else f"{one.time_s:.1f} s"
            refs = " ".join(_reference(ref) for ref in one.refs)
            yield f"<tr><td>{_cycle(one.cycle)}</td><td>{time}</td><td>{escape(one.text)} {refs}</td></tr>"
        yield "</table>"


def _milestones(story: RunStory) -> Iterator[str]:
    for row in story.milestones:
        when, lines, off_mm, _, *odds = (f"<td>{escape(cell)}</td>" for cell in row.cells(""))
        name = f"<td>{escape(row.name)} {' '.join(_reference(ref) for ref in row.refs[:1])}</td>"
        verdict = f'<td class="{escape(row.verdict.replace(" ", "-"))}">{escape(row.verdict)}</td>'
        yield f"<tr><td>{_cycle(row.cycle)}</td>{when}{name}{verdict}{''.join((lines, off_mm, *odds))}</tr>"


def _cycle(cycle: int | None) -> str:
    return "" if cycle is None else f'<button type="button" data-cycle="{cycle}">{cycle}</button>'


def _reference(ref: str) -> str:
    return f'<button type="button" data-entry="{escape(ref)}">{escape(ref)}</button>'
