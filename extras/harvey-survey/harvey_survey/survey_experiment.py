"""Surveys of buildings that their models describe wrongly: is the model better after it, and do missions go as well?

Each wall, door and thing is displaced on its own by 5 cm, which the world file states, and 15 % of the things are gone.
The truth is the simulator's; the survey sees journals alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.generated.missions import write_inexact_mission
from experiments.report import Report
from experiments.trials import campaign_folder, judge_rare, judge_share, run_trials
from harvey.simulation.simulated_run import build_head, run_mission
from harvey_survey.adjustment import Adjustment, SurveyChange, adjust, propose_changes
from harvey_survey.ledger import build_ledger
from harvey_survey.patch_file import build_patch, write_world
from harvey_survey.seen_pictures import read_looks
from logs.run_directory import RunDirectory
from sim.ground_truth.inexact import TrueInexact, displace
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.building.model_errors import WALL
from world_models.building.world import World
from world_models.files.construction.builder import build_world
from world_models.files.construction.specs import WorldSpec
from world_models.files.world_files import fingerprint, load_world
from world_models.units import INCH_M

SIGMA_M, MISSING = 0.05, 0.15
TRUTH = TrueInexact(sigma_m=SIGMA_M, missing=MISSING)
BUILDINGS, MISSIONS, AFTER, ROOMS = 8, 6, 2, 4
QUICK = 1, 3, 1
"""Buildings, missions by which each is surveyed, and missions in the surveyed model."""
FIRST_SEED = 100
"""The floors of seeds 9001 and 9002 are those by which the survey was made."""
SEEN, EXPECTED = 5, 3
"""A landmark counts that was expected in so many pictures; a thing that is gone, in so many."""
MEDIAN_M, MOST_M = 0.01, 0.03
WITHIN_95 = 1.96


@dataclass(frozen=True, slots=True)
class BuildingCase:
    """What is driven: a seed, the missions before and after, and where."""

    seed: int
    missions: int
    after: int
    folder: str


@dataclass(frozen=True, slots=True)
class SurveyedBuilding:
    """How a survey ended.

    Attributes:
        before_m, after_m: how far each landmark that was seen often is from the truth, by the model and surveyed.
        z: of each mode that was seen often, its error in standard deviations.
        gone, gone_found: things that are gone and were expected; those that the survey takes out.
        changes, wrong: changes, and those by which the model is no better.
        reached, driven: missions in the surveyed model that reached their goal within an inch and 5 cm, and all.
    """

    seed: int
    pictures: int
    before_m: list[float]
    after_m: list[float]
    z: list[float]
    gone: int
    gone_found: int
    changes: int
    wrong: int
    reached: int
    driven: int


def survey_building(case: BuildingCase) -> SurveyedBuilding:
    """Drive, survey, judge, and drive again."""
    folder = Path(case.folder) / f"floor-{case.seed}"
    folder.mkdir(parents=True, exist_ok=True)
    paths = [write_inexact_mission(folder, case.seed, TRUTH, stated_m=SIGMA_M, rooms=ROOMS, draw=(17, n),
                                   name=f"mission-{n}") for n in range(case.missions + case.after)]
    runs = []
    for number, path in enumerate(paths[: case.missions]):
        run = RunDirectory(folder / f"run-{number}")
        stage = build_stage(parse_scenario(path.read_text("utf-8"), path.stem, folder))
        run_mission(stage, number, out=run.path, head=build_head(stage, number), recording=False)
        runs.append(run)
    file = folder / f"floor-{case.seed}.toml"
    model = load_world(file)
    looks = read_looks(model, file, runs)
    found = adjust(model, looks, SIGMA_M)
    changes = propose_changes(model, looks, found)
    better = file.with_name("better.toml")
    better.write_bytes(write_world(file, build_patch(file, changes, len(runs), len(looks))))
    truth = SurveyTruth.read(file, case.seed, model)
    ledger = build_ledger(model, looks)
    often = [e.name for e in ledger.elements if e.pictures >= SEEN and e.name not in truth.missing]
    surveyed = load_world(better)
    reached = sum(_drive_after(path, better, number) for number, path in enumerate(paths[case.missions :]))
    gone = {e.name for e in ledger.elements if e.name in truth.missing and e.pictures >= EXPECTED}
    return SurveyedBuilding(
        case.seed, len(looks), [truth.measure(model, name) for name in often],
        [truth.measure(surveyed, name) for name in often],
        truth.compare(found), len(gone), len(gone & {c.name for c in changes if c.is_gone}), len(changes),
        sum(truth.is_wrong(change, model, surveyed) for change in changes), reached, case.after)


def _drive_after(path: Path, better: Path, seed: int) -> bool:
    """Whether a mission whose robot believes in the surveyed model reaches its goal; the building is as it was."""
    stage = build_stage(parse_scenario(path.read_text("utf-8"), path.stem, path.parent))
    head = replace(build_head(stage, seed), world=str(better.resolve()), world_sha256=fingerprint(better))
    out = path.parent / f"after-{seed}"
    result = run_mission(stage, seed, out=out, head=head, recording=False)
    return result.outcome == "reached" and (result.final_error_m or 0.0) <= INCH_M + SIGMA_M


@dataclass(frozen=True, eq=False, slots=True)
class SurveyTruth:
    """The building as it is: its world, what is missing, and the model of it."""

    world: World
    missing: frozenset[str]
    model: World

    @staticmethod
    def read(file: Path, seed: int, model: World) -> SurveyTruth:
        specs: list[WorldSpec] = []

        def keep(spec: WorldSpec) -> WorldSpec:
            specs.append(spec)
            return spec

        load_world(file, details=[file.with_name(f"{file.stem}-details.toml")], altered=keep)
        true = displace(specs[0], replace(TRUTH, seed=seed))
        return SurveyTruth(build_world(true.spec), frozenset(true.missing), model)

    def measure(self, world: World, name: str) -> float:
        """How far a landmark of a model is from the truth [m]; a wall along its normal."""
        own, true = world.landmark(name).lines_world, self.world.landmark(name).lines_world
        if self.model.landmark(name).kind != "wall":
            return float(np.linalg.norm((true - own).mean(axis=(0, 1))))
        flat = np.ptp(own.reshape(-1, 3)[:, :2], axis=0)
        across = int(np.argmin(flat))
        return abs(float(np.median(true[..., across]) - np.median(own[..., across])))

    def displacement(self, way: str, direction: NDArray[np.float64]) -> float | None:
        """How far the truth has a mode [m]; None of what is not there."""
        room, _, number = way.rpartition(WALL)
        if room:
            i = int(number)
            off = self.world.outline(room)[i] - self.model.outline(room)[i]
            return float(off @ direction[:2])
        name = way.rpartition(" ")[0]
        if name in self.missing:
            return None
        off = (self.world.landmark(name).lines_world - self.model.landmark(name).lines_world).mean(axis=(0, 1))
        return float(off @ direction)

    def compare(self, found: Adjustment) -> list[float]:
        """Errors of what was seen often, in standard deviations."""
        shares = []
        for k, way in enumerate(found.ways):
            true_m = self.displacement(way, found.directions[k]) if found.pictures[k] >= SEEN else None
            if true_m is not None:
                shares.append(float((found.offs_m[k] - true_m) / found.sigmas_m[k]))
        return shares

    def is_wrong(self, change: SurveyChange, model: World, surveyed: World) -> bool:
        """Whether a change makes the model no better."""
        if change.is_gone:
            return change.name not in self.missing
        if change.kind == "wall":
            room, _, number = change.name.rpartition(WALL)
            i = int(number)
            true, before, after = (world.outline(room)[i] for world in (self.world, model, surveyed))
            along = np.roll(model.outline(room), -1, axis=0)[i] - before
            across = np.array([-along[1], along[0]])
            return abs(float((after - true) @ across)) >= abs(float((before - true) @ across))
        if change.name in self.missing:
            return True
        names = (mark.name for mark in model.landmarks if f"/{mark.name}".endswith(f"/{change.name}"))
        return self.measure(surveyed, name := next(names)) >= self.measure(model, name)


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Survey 8 buildings by 6 missions each, or so many; quick: one by 3."""
    buildings, each, after = QUICK if quick else (BUILDINGS, MISSIONS, AFTER)
    folder = campaign_folder("survey", seed, quick=quick)
    first = FIRST_SEED + 1000 * seed
    cases = [BuildingCase(first + k, missions or each, after, str(folder)) for k in range(buildings)]
    ends = run_trials(survey_building, cases, SurveyedBuilding, folder, "building")
    return report(ends)


def report(ends: Sequence[SurveyedBuilding]) -> Report:
    """The table and the claims of some buildings."""
    before, after = [m for e in ends for m in e.before_m], [m for e in ends for m in e.after_m]
    z = np.abs([z for e in ends for z in e.z])
    gone, found, changes, wrong, reached, driven = np.sum(
        [(e.gone, e.gone_found, e.changes, e.wrong, e.reached, e.driven) for e in ends], axis=0).tolist()
    held = int(np.count_nonzero(z <= WITHIN_95))
    rows = [(f"floor {e.seed}", e.pictures, len(e.after_m), *_spread_cm(e.before_m), *_spread_cm(e.after_m),
             f"{np.mean(np.abs(e.z) <= WITHIN_95):.0%}" if e.z else "-", f"{e.gone_found}/{e.gone}",
             f"{e.wrong}/{e.changes}", f"{e.reached}/{e.driven}") for e in ends]
    median_m, most_m = (float(np.percentile(after, part)) if after else 0.0 for part in (50, 95))
    return Report(
        "Surveys of buildings whose models are wrong by 5 cm a thing, 15 % gone",
        ("building", "pictures", "landmarks", "before: median cm", "95 % cm", "after: median cm", "after 95 % cm",
         "within 95 %", "gone found", "wrong changes", "missions after"), tuple(rows),
        notes=(
            f"Landmarks that were expected in {SEEN} pictures and more; gone things, in {EXPECTED}. within 95 %: errors"
            " of all that was found of a wall, door or thing, proposed or not, in 1.96 of its stated standard"
            " deviations. A change is wrong that takes out what is there, or makes the model no better. missions after:"
            " the robot believes in the surveyed model, and the building is as it was; within an inch and 5 cm.",
            "Nothing is added that the model lacks: what is new is not surveyed yet.",
        ),
        claims=(
            (f"landmarks are within {100 * MEDIAN_M:g} cm (median): {100 * median_m:.2f} cm", median_m <= MEDIAN_M),
            (f"landmarks are within {100 * MOST_M:g} cm (95 %): {100 * most_m:.2f} cm", most_m <= MOST_M),
            (f"after it they are nearer (median), before {100 * float(np.median(before)):.2f} cm",
             median_m < float(np.median(before))),
            (f"of what is gone at least 90 % is found: {found} of {gone}", judge_share(found, gone, 0.9)),
            (f"at most 1 % of changes are wrong: {wrong} of {changes}", judge_rare(wrong, changes, 0.01)),
            (f"what is stated holds in at least 93 %: {held} of {len(z)}", judge_share(held, len(z), 0.93)),
            (f"missions after it: at least 99 % reach: {reached} of {driven}", judge_share(reached, driven, 0.99)),
        ),
        is_small=len(ends) < BUILDINGS,
    )


def _spread_cm(errors_m: Sequence[float]) -> tuple[float, float]:
    return (float(100.0 * np.median(errors_m)), float(100.0 * np.percentile(errors_m, 95))) if errors_m else (0.0, 0.0)

