"""What a report's page scrubs through: decisions, entries with what they rest on, poses, candidates; the camera's
pictures with the lines in them; and the plan of each storey with both paths."""

from __future__ import annotations

import base64
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from itertools import groupby
from typing import Any, Literal

import numpy as np

from harvey.errors import BadInput
from logs.explain.phrases import sentence
from logs.records import EntryRecord
from logs.timeline import Timeline
from world_models import words
from world_models.building.plan_view import SCALE, DrawnStorey, draw_storeys, drawing_svg
from world_models.building.world import World
from world_models.camera import Camera
from world_models.entries import CameraPicture, Hypothesis, LineMatch, Milestone, PoseFix, Segments


def cycles(history: Timeline) -> Iterator[dict[str, Any]]:
    """Each decision: who acted, woken by what, and what came of it."""
    for decision in history.decisions():
        chosen = decision.chosen
        yield {
            "cycle": decision.cycle, "time_s": history.time_at(decision.cycle), "level": decision.focus,
            "who": "" if chosen is None else words.source(chosen.source),
            "trigger": "" if chosen is None else chosen.trigger,
            "observed": [record.ref for record in decision.observed if not record.is_gone],
            "made": [record.ref for record in decision.made if not record.is_gone],
            "refused": decision.refused}


def entries(history: Timeline) -> dict[str, dict[str, Any]]:
    """Every revision by its ref: what it says, who wrote it when, and what it rests on."""
    found = {}
    for ref in history.refs:
        record = history.entry(ref)
        if record is not None:
            found[ref] = {"says": sentence(record), "by": words.source(record.author), "cycle": record.cycle,
                          "because": list(record.because)}
    return found


def beliefs(history: Timeline, world: World | None) -> Iterator[dict[str, Any]]:
    """Each belief that was held: its pose and ellipse in the world frame; nothing where the world is not known."""
    for record in () if world is None else history.of_kind(Hypothesis):
        value = record.value
        if world is not None and value.is_held:
            yield {"cycle": record.cycle, "ref": record.ref, "locale": value.locale, **placed(value, world)}


def candidates(history: Timeline, world: World | None) -> Iterator[dict[str, Any]]:
    """Each place that came into question: from which cycle until which, and with which weight."""
    for record in () if world is None else history.of_kind(Hypothesis):
        value = record.value
        if world is None or value.status != "candidate":
            continue
        ends = (history.entry(f"{record.id}.{record.revision + 1}"), history.retraction(record.ref))
        yield {"cycle": record.cycle, "until": min((end.cycle for end in ends if end is not None), default=None),
               "ref": record.ref, "locale": value.locale, "weight": value.weight, "place": value.place(),
               "evidence": value.evidence, **placed(value, world)}


def placed(value: Hypothesis, world: World) -> dict[str, float]:
    """Pose [m, rad] and one-sigma ellipse [m; angle of its longer axis, rad] in the world frame."""
    pose = value.world_from_robot(world)
    variances, axes = np.linalg.eigh(value.covariance_world(world)[:2, :2])
    small, large = np.sqrt(np.maximum(variances, 0.0))
    return {"x": pose.x_m, "y": pose.y_m, "heading": pose.heading_rad, "sigma": float(large),
            "sigma_short": float(small), "along": float(np.arctan2(axes[1, 1], axes[0, 1])),
            "sigma_heading": value.sigma_rad}


WIDTH_PX, QUALITY = 320, 55
MOST = 700
"""So many pictures are kept at the most: all that were judged, and of the others each so many'th."""


def place_in_picture(segments_px: Any, camera: Camera | None) -> list[list[float]]:
    """Segments of the rectified picture, which the robot reasons in, as they lie in the camera's own.

    Args:
        segments_px: (n, 2, 2).

    Returns:
        rows of u0, v0, u1, v1, from the picture's upper left corner.
    """
    points = np.asarray(segments_px, float).reshape(-1, 2, 2)
    if camera is not None and camera.pinhole is not camera and len(points):
        points = camera.project(camera.pinhole.rays(points))
    rows: list[list[float]] = np.round(points + 0.5, 1).reshape(-1, 4).tolist()
    return rows


def read_pictures(
    history: Timeline, pictures: Mapping[int, bytes], camera: Camera | None
) -> Iterator[dict[str, Any]]:
    """The pictures that are kept, each since the cycle in which it was seen, with its lines."""
    lines = list_lines(history, camera)
    frames = list(history.of_kind(CameraPicture))
    for record in _chosen(frames, lines):
        number = record.fields.get("number")
        if number not in pictures:
            raise BadInput(f"{record.ref}: expected picture {number!r} among those of the run, got none")
        data, size = shrink(pictures[number], "WEBP")
        yield {"cycle": record.cycle, "ref": record.ref, "webp": data, "size": size, **lines.get(record.id, {})}


def _chosen(frames: Sequence[EntryRecord[Any]], lines: Mapping[str, Any]) -> Sequence[EntryRecord[Any]]:
    others = [record for record in frames if record.id not in lines]
    room = max(1, MOST - (len(frames) - len(others)))
    step = -(-len(others) // room)
    kept = {record.ref for record in others[::step or 1]}
    return [record for record in frames if record.id in lines or record.ref in kept]


def shrink(jpeg: bytes, kind: Literal["JPEG", "WEBP"] = "JPEG") -> tuple[str, tuple[int, int]]:
    """A picture as a smaller one in base 64, and its size before. Raises BadInput where it is none.

    WebP takes half the bytes of JPEG, and twice the time.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        picture = Image.open(BytesIO(jpeg))
        size = picture.size
        picture.draft("RGB", (WIDTH_PX, WIDTH_PX))
        picture.thumbnail((WIDTH_PX, WIDTH_PX))
        out = BytesIO()
        picture.convert("RGB").save(out, kind, quality=QUALITY, optimize=True)
    except (UnidentifiedImageError, OSError) as error:
        raise BadInput(f"expected a picture of the camera as JPEG, got: {error}") from None
    return base64.b64encode(out.getvalue()).decode("ascii"), size


def list_lines(history: Timeline, camera: Camera | None) -> dict[str, dict[str, Any]]:
    """By picture, rows of u0, v0, u1, v1 [px]: what was found, what was expected of a milestone, and what agreed with
    it.
    """
    found: dict[str, dict[str, Any]] = {}
    for record in history.of_kind(Segments):
        found[record.value.frame] = {"found": place_in_picture(record.value.segments_px, camera)}
    for fix in history.of_kind(PoseFix):
        match, seen = history.chain(fix, LineMatch, Segments)
        if match is None or seen is None:
            continue
        frame, agreed = seen.value.frame, fix.value.inliers
        found[frame]["agreed"] = place_in_picture(match.value.segments_px[agreed], camera)
        if (milestone := history.because(match, Milestone)) is not None:
            found[frame] |= {"expected": place_in_picture(milestone.expected_px, camera),
                             "milestone": milestone.name()}
    return found


MARKS = """\
<g class="true mark" hidden="hidden"><path d="M 16 0 L -10 9 L -10 -9 Z"/></g>
<g class="believed mark" hidden="hidden"><ellipse rx="1" ry="1"/><path d="M 16 0 L -10 9 L -10 -9 Z"/></g>
<g class="candidates"></g>"""


def draw_plans(
    world: World, beliefs: Sequence[Mapping[str, Any]], track: Sequence[tuple[int, float, float, float]]
) -> list[dict[str, Any]]:
    """A drawing for each storey on which it believed to be; where it truly was is drawn where it believed to be.

    Args:
        track: (cycle, x [m], y [m], heading [rad]) of the true poses; empty where nobody knows them.

    Returns:
        svg, rooms; scale [units a metre], left and top: the drawing's (x, y) of a point (x, y) of the world is
        scale * (x - left), scale * (top - y).
    """
    been = {belief["locale"] for belief in beliefs}
    storeys = [storey for storey in draw_storeys(world) if been & set(storey.rooms)]
    return [_draw_storey(storey, beliefs, track) for storey in storeys]


def draw_blank_plans(world: World) -> list[dict[str, Any]]:
    """A drawing for every storey, as by :func:`draw_plans`, without paths."""
    return [_draw_storey(storey, (), ()) for storey in draw_storeys(world)]


def _draw_storey(
    storey: DrawnStorey, beliefs: Sequence[Mapping[str, Any]], track: Sequence[tuple[int, float, float, float]]
) -> dict[str, Any]:
    left, top = float(storey.origin[0]), float(storey.origin[1] + storey.drawing.size[1])

    def line(points: Sequence[tuple[float, float]], kind: str) -> str:
        drawn = " ".join(f"{SCALE * (x - left):.1f},{SCALE * (top - y):.1f}" for x, y in points)
        return f'<polyline class="{kind} path" points="{drawn}"/>'

    here = [(one["cycle"], one["x"], one["y"], one["locale"] in storey.rooms) for one in beliefs]
    believed = [[(x, y) for _, x, y, _ in run] for inside, run in groupby(here, key=lambda one: one[3]) if inside]
    true = [(x, y) for cycle, x, y, _ in track if _is_here(here, cycle)]
    more = "\n".join([*([line(true, "true")] if true else []), *(line(one, "believed") for one in believed), MARKS])
    return {"svg": drawing_svg(storey.drawing, more), "rooms": list(storey.rooms), "scale": SCALE, "left": left,
            "top": top}


def _is_here(here: Sequence[tuple[int, float, float, bool]], cycle: int) -> bool:
    """Whether the belief of a cycle is on the storey."""
    before = bisect_right(here, cycle, key=lambda one: one[0])
    return bool(here) and here[max(0, before - 1)][3]
