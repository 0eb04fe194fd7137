"""The pictures of README, each drawn from a run that is driven for it.

    python -m docs.tools.pictures FOLDER [NAME ...]

The runs are kept in FOLDER, and driven where they are not there yet; the pictures are written to ``docs/pictures``.
Seeds stand in RUNS. The recording's picture is the viewer's own: ``python -m docs.tools.look``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import harvey  # before numpy: it tells the libraries how to calculate

# isort: split
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from experiments.generated.missions import write_twin_mission
from harvey.commands.plan_picture import LINES, LOOKS
from harvey.report import data
from logs.pictures import open_pictures
from logs.reader import read_true_track
from logs.recording.palette import BELIEVED, CANDIDATE, EXPECTED, MATCHED, REJECTED, TRUE
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline
from world_models import words
from world_models.building.plan_view import draw_storeys
from world_models.building.world import World
from world_models.entries import CameraPicture, Certificate, DoorState, FreeFloor, Milestone, Obstacle

OUT = Path(__file__).parents[1] / "pictures"
TWINS = "twins"
RUNS: Mapping[str, tuple[str, int]] = {
    "office": ("lab-to-allens-office", 0), "kidnap": ("hallway-kidnap", 0), "box": ("box-in-the-way", 0),
    "door": ("door-found-shut", 0), TWINS: (TWINS, 7),
}
"""Scenario and seed of each run; twins: a generated floor of identical rooms, and it is in another one than told."""
WIDE_IN, HIGH_IN, DOTS, QUALITY = 6.4, 3.2, 100, 70
BEFORE, AFTER, FRAMES, LASTS_MS, LAST_MS = 24, 10, 22, 800, 3000
"""Of the moving picture: cycles before it is lost and after it is found, in about so many pictures, each so long."""
ROBOT = np.array([(0.45, 0.0), (-0.3, 0.27), (-0.3, -0.27)])


class Run:
    """A run with what the pictures show of it."""

    def __init__(self, path: Path) -> None:
        files = RunDirectory(path)
        self.history = Timeline(files.journal)
        self.head = RunHead.read(path)
        self.world: World = self.head.load_world()
        self.beliefs = list(data.beliefs(self.history, self.world))
        self.candidates = list(data.candidates(self.history, self.world))
        self.track = np.array(read_true_track(files.recording))
        self.jpegs = open_pictures(files)

    @cached_property
    def lines(self) -> Mapping[str, Mapping[str, Any]]:
        """Lines by picture: found, expected and agreed."""
        return data.list_lines(self.history, self.head.model(self.world).camera)

    def of_kind(self, kind: type[Any]) -> Iterator[Any]:
        """Its records that say something, in their order."""
        return (record for record in self.history.of_kind(kind) if not record.is_gone)

    def picture_at(self, cycle: int) -> Any:
        """The newest picture that was seen up to a cycle."""
        return [record for record in self.of_kind(CameraPicture) if record.cycle <= cycle][-1]

    def truth_at(self, cycle: int) -> Any:
        """(x, y, heading) where it truly was."""
        return self.track[np.searchsorted(self.track[:, 0], cycle, side="right") - 1, 1:]

    def belief_at(self, cycle: int) -> Mapping[str, Any]:
        """The pose that was held."""
        return [one for one in self.beliefs if one["cycle"] <= cycle][-1]

    def turn(self, kind: str, after: int = 0) -> int:
        """The cycle of the first turning point of a kind."""
        from logs.explain.turning_points import read_turning_points

        return next(p.cycle for p in read_turning_points(self.history) if p.kind == kind and p.cycle >= after)


def colour(rgba: tuple[int, int, int, int], opacity: float = 1.0) -> tuple[float, float, float, float]:
    """A colour of the recording for matplotlib, darker on a light ground."""
    red, green, blue = (0.75 * part / 255 for part in rgba[:3])
    return (red, green, blue, opacity)


@contextmanager
def sheet(name: str, title: str) -> Iterator[tuple[Axes, Axes]]:
    """Axes for a plan and for a camera picture, side by side; at the end they are written to NAME.webp."""
    figure = Figure(figsize=(WIDE_IN, HIGH_IN), dpi=DOTS, facecolor="white")
    yield axes_of(figure, title)
    save(figure).save(OUT / f"{name}.webp", quality=QUALITY, method=6)


def axes_of(figure: Figure, title: str) -> tuple[Axes, Axes]:
    """Plan on the left, picture on the right."""
    high = 0.9
    plan = figure.add_axes((0.0, 0.0, 1.0 - high * HIGH_IN / WIDE_IN - 0.01, high))
    picture = figure.add_axes((1.0 - high * HIGH_IN / WIDE_IN, 0.0, high * HIGH_IN / WIDE_IN, high))
    for axes in (plan, picture):
        axes.set_axis_off()
    figure.text(0.01, 0.95, title, fontsize=10, va="center", fontweight="bold")
    return plan, picture


def save(figure: Figure) -> Image.Image:
    """The figure as a picture."""
    out = BytesIO()
    figure.savefig(out, format="png")
    return Image.open(out).convert("RGB")


def draw_plan(axes: Axes, world: World, middle: Any, wide_m: float) -> None:
    """The plan round a point, with a scale of one metre."""
    box = axes.get_position()
    high_m = wide_m * box.height * HIGH_IN / (box.width * WIDE_IN)
    storey = draw_storeys(world)[0]
    for shape in storey.drawing.shapes:
        x, y = (shape.points + storey.origin).T
        if shape.kind in LOOKS:
            face, edge = LOOKS[shape.kind]
            axes.fill(x, y, facecolor=face, edgecolor=edge, linewidth=0.8)
        elif shape.kind in LINES and shape.kind != "axis":
            axes.plot(x, y, color=LINES[shape.kind][0], linewidth=2)
    left, low = middle[0] - wide_m / 2, middle[1] - high_m / 2
    axes.set_xlim(left, left + wide_m)
    axes.set_ylim(low, low + high_m)
    one, up = left + 0.03 * wide_m, low + 0.05 * high_m
    axes.plot((one, one + 1), (up, up), color="black", linewidth=2)
    axes.text(one + 1.15, up, "1 m", fontsize=8, va="center")


def draw_robot(axes: Axes, pose: Sequence[float], face: Any, label: str = "") -> None:
    """A triangle that points where the robot looks."""
    x, y, heading = pose
    turn = np.array([(np.cos(heading), np.sin(heading)), (-np.sin(heading), np.cos(heading))])
    axes.fill(*(ROBOT @ turn + (x, y)).T, facecolor=face, edgecolor="black", linewidth=0.7, zorder=9, label=label)


def draw_both(axes: Axes, run: Run, cycle: int) -> None:
    """Where it is, and where it believes to be."""
    held = run.belief_at(cycle)
    draw_robot(axes, run.truth_at(cycle), colour(TRUE), "in truth")
    draw_robot(axes, (held["x"], held["y"], held["heading"]), colour(BELIEVED, 0.7), "believed")


def draw_path(axes: Axes, run: Run, until: float = np.inf) -> None:
    """Where it truly drove, up to a cycle."""
    here = run.track[run.track[:, 0] <= until]
    axes.plot(here[:, 1], here[:, 2], color=colour(TRUE), linewidth=1.8, label="driven")


def legend(axes: Axes) -> None:
    """In a corner."""
    axes.legend(loc="upper left", fontsize=7, framealpha=0.85, borderpad=0.3)


def draw_picture(axes: Axes, run: Run, record: Any, *, expected: bool = True) -> None:
    """What the camera saw, the lines that were expected (yellow), and of the found ones those that agree (green)."""
    seen = np.asarray(Image.open(BytesIO(run.jpegs[record.fields["number"]])).convert("RGB"))
    axes.imshow(seen, extent=(0, seen.shape[1], seen.shape[0], 0), aspect="auto")
    axes.set_xlim(0, seen.shape[1])
    axes.set_ylim(seen.shape[0], 0)
    lines = run.lines.get(record.id, {}) if expected else {}
    for kind, tone, wide in (("expected", EXPECTED, 1.0), ("agreed", MATCHED, 1.6)):
        for u0, v0, u1, v1 in lines.get(kind, ()):
            axes.plot((u0, u1), (v0, v1), color=tuple(part / 255 for part in tone), linewidth=wide)


def draw_certificate(run: Run) -> None:
    """A milestone that is verified."""
    verified = [record for record in run.of_kind(Certificate) if record.value.verdict == "verified"]
    found = max(verified[2:], key=lambda record: record.value.matched)
    milestone = run.history.reason(found, Milestone)
    record = run.picture_at(found.cycle)
    said = found.value
    title = (f"{milestone.value.name()}: {said.verdict}, {said.matched} of {said.expected} lines;"
             f" p wrong {said.p_wrong:.1g}")
    with sheet("certificate", title) as (plan, picture):
        draw_plan(plan, run.world, run.truth_at(found.cycle)[:2], 14.0)
        draw_both(plan, run, found.cycle)
        legend(plan)
        draw_picture(picture, run, record)


def draw_found(run: Run) -> None:
    """The places that come into question while it is lost."""
    lost = run.turn("lost")
    found = run.turn("found", lost)
    open_now = [one for one in run.candidates if lost <= one["cycle"] <= found]
    places = words.count(len(open_now), "place")
    title = f"lost in cycle {lost}, found in cycle {found}: {places} came into question"
    with sheet("found", title) as (plan, picture):
        draw_plan(plan, run.world, run.truth_at(found)[:2], 8.0)
        _draw_candidates(plan, open_now)
        draw_both(plan, run, lost)
        legend(plan)
        draw_picture(picture, run, run.picture_at(lost))


def _draw_candidates(axes: Axes, candidates: Sequence[Mapping[str, Any]]) -> None:
    for number, one in enumerate(candidates):
        draw_robot(axes, (one["x"], one["y"], one["heading"]), colour(CANDIDATE, 0.5), "" if number else "may be")


def draw_box(run: Run) -> None:
    """Something on the floor that the model lacks."""
    seen = next(record for record in run.of_kind(FreeFloor) if record.value.things)
    thing = [record.value for record in run.of_kind(Obstacle) if record.value.is_there][-1]
    title = (f"{thing.name}: {thing.width_m:.1f} m wide, {thing.height_m:.1f} m high,"
             f" {100 * thing.certainty:.0f}% certain")
    with sheet("box", title) as (plan, picture):
        corners = np.array(thing.footprint)
        draw_plan(plan, run.world, corners.mean(axis=0), 11.0)
        draw_path(plan, run)
        plan.fill(*corners.T, color=colour(REJECTED), label="seen, not in the model")
        legend(plan)
        draw_picture(picture, run, run.picture_at(seen.cycle), expected=False)
        left, top, right, bottom = seen.value.things[0].box_px
        picture.plot((left, right, right, left, left), (top, top, bottom, bottom, top),
                     color=tuple(part / 255 for part in REJECTED), linewidth=1.6)


def draw_door(run: Run) -> None:
    """A door of the model that is shut."""
    shut = next(record for record in run.of_kind(DoorState) if record.value.state == "shut")
    x0, y0 = run.track[:, 1:3].min(axis=0)
    x1, y1 = run.track[:, 1:3].max(axis=0)
    title = f"{shut.value.door} is shut, {100 * shut.value.certainty:.1f}% certain: another way is taken"
    with sheet("door", title) as (plan, picture):
        draw_plan(plan, run.world, ((x0 + x1) / 2, (y0 + y1) / 2), 24.0)
        draw_path(plan, run)
        draw_both(plan, run, shut.cycle)
        legend(plan)
        draw_picture(picture, run, run.picture_at(shut.cycle), expected=False)


def draw_twins(run: Run) -> None:
    """It was told another room than the one where it is: until it is lost it drives in both."""
    lost = run.turn("lost")
    held, truth = run.belief_at(lost), run.truth_at(lost)
    off_m = float(np.hypot(held["x"] - truth[0], held["y"] - truth[1]))
    places = np.array([(one["x"], one["y"]) for one in run.beliefs if one["cycle"] <= lost]
                      + [(x, y) for cycle, x, y, _ in run.track if cycle <= lost])
    low, high = places.min(axis=0), places.max(axis=0)
    title = f"told the wrong one of identical rooms: lost in cycle {lost}, {off_m:.1f} m off"
    with sheet("twins", title) as (plan, picture):
        draw_plan(plan, run.world, (low + high) / 2, float((high - low).max()) * 1.4)
        draw_path(plan, run, until=lost)
        plan.plot(*np.array([(one["x"], one["y"]) for one in run.beliefs if one["cycle"] <= lost]).T,
                  color=colour(BELIEVED), linewidth=1.8)
        draw_both(plan, run, lost)
        legend(plan)
        draw_picture(picture, run, run.picture_at(lost))


def _is_open(one: Mapping[str, Any], cycle: int) -> bool:
    return bool(one["cycle"] <= cycle and (one["until"] is None or one["until"] > cycle))


def draw_replay(path: Path, run: Run) -> None:
    """Every decision by who made it, and whether it is made again."""
    other = harvey.open_run(path).replay()
    made = [(decision.cycle, words.source(decision.chosen.source)) for decision in run.history.decisions()
            if decision.chosen is not None]
    names = list(dict.fromkeys(name for _, name in made))
    said = "all the same, byte for byte" if other is None else f"different from cycle {other} on"
    figure = Figure(figsize=(WIDE_IN, HIGH_IN), dpi=DOTS, facecolor="white")
    axes = figure.add_axes((0.24, 0.13, 0.74, 0.77))
    axes.plot([cycle for cycle, _ in made], [names.index(name) for _, name in made], "|", markersize=4, color="#1f6fb4")
    axes.set_yticks(range(len(names)), names, fontsize=5.5)
    axes.invert_yaxis()
    axes.set_xlabel("cycle", fontsize=7, labelpad=1)
    axes.tick_params(axis="x", labelsize=7)
    axes.grid(alpha=0.3)
    title = f"{len(run.history.cycles)} decisions, made again from {len(run.jpegs)} pictures: {said}"
    figure.text(0.01, 0.95, title, fontsize=10, va="center", fontweight="bold")
    save(figure).save(OUT / "replay.webp", quality=QUALITY, method=6)


def draw_rescue(run: Run) -> None:
    """The moving picture: kidnapped, refuted, lost, found."""
    lost = run.turn("lost")
    found = run.turn("found", lost)
    cycles = range(lost - BEFORE, found + AFTER + 1)
    shown = sorted({*cycles[::max(1, len(cycles) // FRAMES)], lost, found, found + AFTER})
    frames = []
    for cycle in shown:
        state = "LOST" if lost <= cycle < found else "found again" if cycle >= found else "driving"
        figure = Figure(figsize=(WIDE_IN, HIGH_IN), dpi=1.25 * DOTS, facecolor="white")
        plan, picture = axes_of(figure, f"cycle {cycle}: {state}")
        draw_plan(plan, run.world, run.truth_at(found)[:2], 10.0)
        _draw_candidates(plan, [one for one in run.candidates if _is_open(one, cycle) and lost <= cycle])
        draw_both(plan, run, cycle)
        legend(plan)
        draw_picture(picture, run, run.picture_at(cycle))
        frames.append(save(figure))
    lasts = [LASTS_MS] * (len(frames) - 1) + [LAST_MS]
    frames[0].save(OUT / "rescue.webp", save_all=True, append_images=frames[1:], duration=lasts, loop=0, quality=45)


class Drawn(NamedTuple):
    """A picture: the run that it shows, and how it is drawn."""

    run: str
    draw: Callable[[Run], None]


PICTURES: Mapping[str, Drawn] = {
    "rescue": Drawn("kidnap", draw_rescue), "certificate": Drawn("office", draw_certificate),
    "found": Drawn("kidnap", draw_found), "box": Drawn("box", draw_box), "door": Drawn("door", draw_door),
    "twins": Drawn(TWINS, draw_twins),
}


def drive(name: str, folder: Path) -> Path:
    """The directory of a run, driven where it is not there yet."""
    scenario, seed = RUNS[name]
    out = folder / f"{scenario}-{seed}"
    if not (out / "result.json").is_file():
        mission = scenario
        if name == TWINS:
            (folder / TWINS).mkdir(parents=True, exist_ok=True)
            mission = str(write_twin_mission(folder / TWINS, seed, is_told_right=False).path)
        print(f"{scenario}, seed {seed}: {harvey.run(mission, seed=seed, out=out).outcome}")
    return out


def main() -> int:
    """Draw those that are named, or all."""
    folder, *names = sys.argv[1:]
    OUT.mkdir(exist_ok=True)
    for name in names or (*PICTURES, "replay"):
        if name == "replay":
            path = drive("office", Path(folder))
            draw_replay(path, Run(path))
        else:
            PICTURES[name].draw(Run(drive(PICTURES[name].run, Path(folder))))
        print(f"{name}.webp: {(OUT / f'{name}.webp').stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
