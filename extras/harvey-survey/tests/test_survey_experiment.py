"""The experiment of surveys: its truth is that of the simulator."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.generated.missions import write_inexact_mission
from harvey_survey.adjustment import SurveyChange
from harvey_survey.survey_experiment import ROOMS, SIGMA_M, TRUTH, SurveyedBuilding, SurveyTruth, report
from world_models.files.world_files import load_world

SEED = 9001


def test_truth_is_centimetres_from_the_model(tmp_path: Path) -> None:
    write_inexact_mission(tmp_path, SEED, TRUTH, stated_m=SIGMA_M, rooms=ROOMS)
    file = tmp_path / f"floor-{SEED}.toml"
    model = load_world(file)
    truth = SurveyTruth.read(file, SEED, model)
    names = [mark.name for mark in model.landmarks if mark.kind != "wall" and mark.name not in truth.missing]
    off_m = [truth.measure(model, name) for name in names]
    assert 0.02 < np.median(off_m) < 0.12 and all(truth.measure(truth.world, name) == 0.0 for name in names)
    name = names[0]
    there = np.mean(truth.world.landmark(name).lines_world - model.landmark(name).lines_world, axis=(0, 1))
    direction = there / np.linalg.norm(there)
    assert truth.displacement(f"{name} along", direction) == pytest.approx(np.linalg.norm(there))
    kept, missing = SurveyChange("thing", names[-1], {}, {}, 1.0, ""), sorted(truth.missing)[0]
    assert truth.is_wrong(kept, model, model) and not truth.is_wrong(replace(kept, name=missing), model, model)
    assert truth.displacement(f"{missing} along", direction) is None


def test_report_judges_in_three_words() -> None:
    good = SurveyedBuilding(1, 40, [0.05, 0.04], [0.004, 0.006, 0.02], [0.3, -1.2], 3, 3, 9, 0, 2, 2)
    bad = replace(good, after_m=[0.06, 0.09], z=[4.0, 0.1], gone_found=0, wrong=5, reached=0)
    assert {found for _, found in report([good]).findings} == {"not contradicted"}
    assert len(report([bad]).failing) == 7
