"""Integrity, in aviation's words: does every pose say how far off it may be, and is the robot never further off?

One fault a mission, from barely noticeable to gross, of camera, wheels or building. Each certified fix and each belief
on which a motion is commanded has an error, from the truth, and a protection level (PL), from the board: the robot says
that it is no further off, at a risk of 1e-4. An alert limit (AL) is what a mission can bear. Available: PL <= AL.
Misleading (MI): error > PL. Hazardously misleading (HMI): error > AL >= PL, and no word of being lost.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from blackboard import Change, Decision, Entry, Level, Retracted
from experiments import drives
from experiments.differences.obstacles import Lacking
from experiments.generated.missions import FOCAL_PX, write_inexact_mission
from experiments.report import OURS, PAPER, PEER, Cell, Claim, Report, chart, count_kinds
from experiments.trials import RESULTS, at_most, campaign_folder, judge_rare, judge_share, run_trials
from harvey.campaign.mission_task import Task
from sim.body.simulated_body import SimulatedBody
from sim.ground_truth.inexact import EXACT
from sim.render.sensor import SensorParameters
from sim.scenario_names import SCENARIOS
from world_models import entries
from world_models.entries import ALERT_LIMIT_M, RISK, Discrepancy
from world_models.frames import Pose2

MIN_AVAILABLE, MIN_NAMED = 0.95, 0.95
DOUBTS = ("refuted", "not testable", "lost", "no way on")
"""Words of the board that warn and name no fault."""
NO_FAULT = "no fault"


class Kind(NamedTuple):
    """A kind of fault: its size, the tables of a scenario that make it, and the words of the board that name it."""

    least: float
    most: float
    unit: str
    text: str
    named: Sequence[str] = ()


class Where(NamedTuple):
    """A mission that is driven: a scenario, or a generated floor; in which hall, and after what way, things happen."""

    scenario: str
    hall: str
    after_m: float
    settings: Mapping[str, str]


TABLES = tomllib.loads(Path(__file__).with_name("integrity_faults.toml").read_text("utf-8"))
KINDS: Mapping[str, Kind] = {name: Kind(**table) for name, table in TABLES["faults"].items()}
PLACES: Mapping[str, Where] = {name: Where(**table) for name, table in TABLES["places"].items()}


@dataclass(frozen=True, slots=True)
class Trial:
    """A mission: its fault, its place, and the seed of all that is drawn."""

    kind: str
    place: str
    seed: int

    @property
    def size(self) -> float:
        """Of the fault."""
        kind, rng = KINDS[self.kind], np.random.default_rng([self.seed, 13])
        return math.exp(rng.uniform(math.log(kind.least), math.log(kind.most)))

    def write(self, folder: Path) -> Path:
        """Write the scenario; returns its path. Half of the faults that have a direction are negative."""
        size, where = self.size, PLACES[self.place]
        x = size if np.random.default_rng([self.seed, 17]).random() < 0.5 else -size
        more = "\n" + KINDS[self.kind].text.format(
            x=x, size=size, hall=where.hall, after=where.after_m, seed=self.seed, focal=FOCAL_PX * x / 100.0,
            gain=SensorParameters().gain / size)
        if not where.scenario:
            return write_inexact_mission(folder, self.seed, EXACT, more=more)
        path = folder / f"{where.scenario}-{self.seed}.toml"
        path.write_text((SCENARIOS / f"{where.scenario}.toml").read_text("utf-8") + more, "utf-8")
        return path


class Point(NamedTuple):
    """A pose that was said: in which cycle, its protection level and its error [m]."""

    cycle: int
    level_m: float
    error_m: float

    @property
    def is_misleading(self) -> bool:
        return self.error_m > self.level_m

    @property
    def is_hazardous(self) -> bool:
        return self.error_m > ALERT_LIMIT_M >= self.level_m

    @property
    def badness(self) -> tuple[bool, float]:
        return self.is_hazardous, self.error_m / self.level_m


@dataclass(frozen=True, slots=True)
class Flight:
    """What came of a mission.

    Attributes:
        fixes, beliefs: a point for each certified fix, and for each belief on which a motion was commanded.
        alerts: words that warned or named something, with the time from the fault on; before it there is none.
    """

    kind: str
    place: str
    seed: int
    size: float
    outcome: str
    fixes: list[Point]
    beliefs: list[Point]
    alerts: dict[str, float]

    @staticmethod
    def of_record(record: Mapping[str, Any]) -> Flight:
        """From JSON types."""
        points = {name: [Point(*point) for point in record[name]] for name in ("fixes", "beliefs")}
        return Flight(**{**record, **points})

    @property
    def is_named(self) -> bool:
        """Whether the fault was named."""
        return any(word in self.alerts for word in KINDS[self.kind].named)

    @property
    def alert_s(self) -> float | None:
        """When the robot first doubted its place, or named the fault."""
        return min((s for word, s in self.alerts.items() if word not in self.named_otherwise), default=None)

    @property
    def is_plain(self) -> bool:
        """Whether the fault is above twice its least size, and something on the board can name it."""
        return bool(KINDS[self.kind].named) and self.size > 2.0 * KINDS[self.kind].least

    @property
    def named_otherwise(self) -> list[str]:
        """Faults that were named, and are none."""
        return [word for word in self.alerts if word not in (*DOUBTS, *KINDS[self.kind].named)]


def protection_level(entry: Entry[Any]) -> float:
    """How far off a pose on the board may be, as it says [m]."""
    value = entry.value
    return float(value.protection.place_m if isinstance(value, entries.PoseFix) else value.protection_m)


def list_words(value: Any, lacking: Lacking) -> Iterator[str]:
    """The words by which an entry warns, or names what is wrong; a thing is false where the model lacks nothing."""
    match value:
        case entries.CameraState():
            yield from (f"camera {lesson.what}" for lesson in entries.find_camera_lessons(value.as_nominal(), value))
        case entries.Difference() if value.is_sure and value.leader.kind != "thing":
            yield value.leader.kind
        case entries.BodyFault():
            yield value.what
        case entries.Certificate() if value.verdict != "verified":
            yield "dark" if "is dark" in value.reason else value.verdict
        case Discrepancy() if value.level is Level.GOAL and value.is_open:
            yield "lost"
        case entries.Impasse() if value.is_open:
            yield "no way on"
        case entries.Obstacle() if value.is_there:
            yield "false thing" if lacking.is_false(value.footprint) else "thing"
        case entries.Obstruction():
            yield "hidden"


@dataclass
class Witness:
    """A sink that compares what is said with the truth.

    Attributes:
        is_from_start: whether the fault is there from the start; else it is as soon as the body says so.
        lacking: what the model lacks.
        body: with the truth, once there is one.
        fixes, beliefs, alerts: as of :class:`Flight`.
    """

    is_from_start: bool
    lacking: Lacking
    body: SimulatedBody | None = None
    fixes: list[Point] = field(default_factory=list)
    beliefs: list[Point] = field(default_factory=list)
    alerts: dict[str, float] = field(default_factory=dict)
    _onset_s: float | None = None
    _fix: Entry[Any] | None = None
    _belief: Entry[Any] | None = None
    _lost: set[str] = field(default_factory=set)

    def __call__(self, decision: Decision) -> None:
        body = self.body
        assert body is not None
        if self._onset_s is None and (self.is_from_start or body.happened):
            self._onset_s = 0.0 if self.is_from_start else body.time_s
        for change in (*decision.observed, *decision.made):
            self._take(change, decision.cycle, body)

    def _take(self, change: Change, cycle: int, body: SimulatedBody) -> None:
        entry, value, is_gone = change.entry, change.entry.value, isinstance(change, Retracted)
        if self._onset_s is not None and not is_gone:
            for word in list_words(value, self.lacking):
                self.alerts.setdefault(word, body.time_s - self._onset_s)
        if isinstance(value, Discrepancy) and value.level is Level.GOAL:
            (self._lost.add if value.is_open and not is_gone else self._lost.discard)(entry.id)
        elif isinstance(value, entries.Hypothesis) and value.is_held:
            self._belief = None if is_gone else entry
        elif isinstance(value, entries.PoseFix):
            self._fix = entry
        elif isinstance(value, entries.Certificate) and value.verdict == "verified" and self._fix and not is_gone:
            self._compare(self._fix, self._fix.value.world_from_robot, self.fixes, cycle, body)
        elif isinstance(value, entries.MotorCommand | entries.Course) and self._belief and not is_gone:
            held = self._belief.value
            there = held.locale_from_robot
            pose = body.world_from_place(entries.Place(held.locale, there.x_m, there.y_m, there.heading_rad))
            self._compare(self._belief, pose, self.beliefs, cycle, body)

    def _compare(self, said: Entry[Any], pose: Pose2, points: list[Point], cycle: int, body: SimulatedBody) -> None:
        if not self._lost:  # what is said while it says that it is lost misleads nobody
            points.append(Point(cycle, protection_level(said), pose.distance_to(body.truth.world_from_robot)))


def drive(trial: Trial) -> Flight:
    """Drive the mission of a trial."""
    kind, settings = KINDS[trial.kind], tuple(PLACES[trial.place].settings.items())
    with TemporaryDirectory() as folder:
        task = Task(str(trial.write(Path(folder))), settings, trial.seed)
        witness = Witness("[[faults]]" not in kind.text, Lacking.of_stage(task.stage()))
        end = drives.drive_beside(task, witness).result.outcome
    alerts = {word: s for word, s in witness.alerts.items() if word != "thing" or word in kind.named}  # it is there
    return Flight(trial.kind, trial.place, trial.seed, trial.size, end, witness.fixes, witness.beliefs, alerts)


EACH, QUICK_EACH, CALM, QUICK_CALM = 8, 2, 40, 8
"""Missions of each fault, and without one."""
WORST_SHOWN = 8
LEAST_M, MOST_M = 1e-4, 20.0
"""Of the plot's axes."""
COLUMNS = ("fault", "missions", "reached", "fixes", "MI", "HMI", "beliefs", "MI ", "HMI ", "available", "named",
           "alert s", "worst s", "never", "named otherwise")


def run(quick: bool, seed: int) -> Report:
    """Drive so many missions of each fault, in turn at each of the places, and more without a fault."""
    each, calm, first = QUICK_EACH if quick else EACH, QUICK_CALM if quick else CALM, drives.first_seed(seed)
    places = list(PLACES)
    trials = [Trial(kind, places[(k + number) % len(places)], first + 100 * number + k)
              for number, kind in enumerate(KINDS) for k in range(calm if kind == NO_FAULT else each)]
    folder = campaign_folder("integrity", seed, quick=quick)
    flights = run_trials(drive, trials, Flight, folder, "mission")
    picture = folder / "stanford.png"
    draw(flights, picture)
    report = Report(
        "Integrity: is a pose ever further off than it says?", COLUMNS,
        tuple(_row(kind, [f for f in flights if f.kind == kind]) for kind in KINDS),
        notes=(
            f"AL: alert limit, {ALERT_LIMIT_M} m. PL: protection level, as the pose says, at a risk of {RISK:g}. MI:"
            " misleading, error > PL. HMI: hazardously misleading, error > AL >= PL. First of certified fixes, then of"
            " beliefs on which a motion was commanded; what is said while the robot says that it is lost misleads"
            " nobody. available: fixes with PL <= AL.",
            "named: missions in which the board named the fault, of those where it is above twice its least size."
            " alert: time from the fault to its name or the first doubt of the place, median and worst; never: missions"
            " without. named otherwise: what was named and is none. Without a fault all of these are false alerts."
            " A thing that the model lacks and that stands where it is said is none.",
            f"Places: {', '.join(PLACES)}. The paper has no integrity, and {drives.NO_PEER}",
            *_tell_worst(flights, folder), f"Stanford plot: {picture}; one line per mission: {folder / RESULTS}",
        ),
        claims=tuple(_claims(flights)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def _row(kind: str, flights: Sequence[Flight]) -> tuple[Cell, ...]:
    fixes, beliefs = _points(flights, "fixes"), _points(flights, "beliefs")
    plain = [f for f in flights if f.is_plain]
    alerts = [f.alert_s for f in flights if f.alert_s is not None]
    return (
        kind, len(flights), sum(f.outcome == "reached" for f in flights),
        len(fixes), sum(p.is_misleading for p in fixes), sum(p.is_hazardous for p in fixes),
        len(beliefs), sum(p.is_misleading for p in beliefs), sum(p.is_hazardous for p in beliefs),
        f"{np.mean([p.level_m <= ALERT_LIMIT_M for p in fixes]):.0%}" if fixes else None,
        f"{sum(f.is_named for f in plain)} of {len(plain)}" if plain else None,
        round(float(np.median(alerts)), 1) if alerts else None, round(max(alerts), 1) if alerts else None,
        len(flights) - len(alerts), count_kinds(word for f in flights for word in f.named_otherwise),
    )


def _points(flights: Sequence[Flight], what: str) -> list[Point]:
    return [point for flight in flights for point in getattr(flight, what)]


def _claims(flights: Sequence[Flight]) -> Iterator[Claim]:
    calm, faulty = [f for f in flights if f.kind == NO_FAULT], [f for f in flights if f.kind != NO_FAULT]
    for name, some in ((NO_FAULT, calm), ("one fault", faulty)):
        for what in ("fixes", "beliefs"):
            for word, is_bad in (("misleading", "is_misleading"), ("hazardously misleading", "is_hazardous")):
                points = _points(some, what)
                bad, of = sum(getattr(p, is_bad) for p in points), len(points)
                yield (f"{name}: of the {what} at most {RISK:g} are {word}: {bad} of {of}, so at most"
                       f" {at_most(bad, of):.2%}", judge_rare(bad, of, RISK))
    fixes = _points(calm, "fixes")
    available = sum(p.level_m <= ALERT_LIMIT_M for p in fixes)
    yield (f"{NO_FAULT}: of the fixes at least {MIN_AVAILABLE:.0%} are available: {available} of {len(fixes)}",
           judge_share(available, len(fixes), MIN_AVAILABLE))
    false = sum(bool(f.alerts) for f in calm)
    yield f"{NO_FAULT}: no mission has an alert: {false} of {len(calm)}", judge_rare(false, len(calm), 0.0)
    plain = [f for f in faulty if f.is_plain]
    named = sum(f.is_named for f in plain)
    yield (f"one fault: at least {MIN_NAMED:.0%} of those that can be named, and are above twice the least size, are:"
           f" {named} of {len(plain)}", judge_share(named, len(plain), MIN_NAMED))


def _tell_worst(flights: Sequence[Flight], folder: Path) -> Iterator[str]:
    """The worst point of each mission that misleads, the worst missions first, with a scenario file that shows it."""
    worst = [(max((p for p in (*f.fixes, *f.beliefs) if p.is_misleading), key=lambda p: p.badness), f) for f in flights
             if any(p.is_misleading for p in (*f.fixes, *f.beliefs))]
    for p, f in sorted(worst, key=lambda one: one[0].badness, reverse=True)[:WORST_SHOWN]:
        path = Trial(f.kind, f.place, f.seed).write(folder)
        changes = "".join(f" --set '{key}={value}'" for key, value in PLACES[f.place].settings.items())
        yield (f"among the worst: {f.kind}, {f.size:.3g} {KINDS[f.kind].unit}, {f.place}: cycle {p.cycle}, the"
               f" {'fix' if p in f.fixes else 'belief'} is {1000.0 * p.error_m:.0f} mm off, PL"
               f" {1000.0 * p.level_m:.0f} mm. See it: harvey run {path} --seed {f.seed}{changes}")


def draw(flights: Sequence[Flight], path: Path) -> None:
    """Draw errors against protection levels, as in Stanford's diagram: what is above the diagonal is as it says."""
    with chart(path, "Integrity: certified fixes and beliefs", "error [m]", "protection level [m]", (7.0, 6.0)) as axes:
        for what, marker, size in (("beliefs", ".", 4.0), ("fixes", "o", 14.0)):
            for some, colour, name in ((False, PEER, "one fault"), (True, OURS, NO_FAULT)):
                points = _points([f for f in flights if (f.kind == NO_FAULT) is some], what)
                axes.scatter([max(p.error_m, LEAST_M) for p in points], [max(p.level_m, LEAST_M) for p in points],
                             s=size, marker=marker, color=colour, alpha=0.4, linewidths=0.0, label=f"{what}, {name}")
        axes.plot([LEAST_M, MOST_M], [LEAST_M, MOST_M], color="black", linewidth=0.8, label="error = PL")
        axes.axvline(ALERT_LIMIT_M, color=PAPER, linestyle="--", label="alert limit")
        axes.axhline(ALERT_LIMIT_M, color=PAPER, linestyle="--")
        axes.set(xscale="log", yscale="log", xlim=(LEAST_M, MOST_M), ylim=(LEAST_M, MOST_M))


