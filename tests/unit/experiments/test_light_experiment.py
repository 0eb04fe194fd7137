"""Missions under light: what is written, what is claimed, and the small version."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from driven_here import run_here
from experiments.differences import light
from experiments.differences.light import LightResult, LightTrial, run_light_mission, write_light_mission
from experiments.generated.light import LIGHT_KINDS, LightKind, draw_light
from sim.render.light.lighting import Lighting
from sim.scenario import load_scenario


def end(trial: LightTrial, **other: Any) -> LightResult:
    """A flawless end, or one with flaws."""
    values: dict[str, Any] = {
        "outcome": "reached", "reason": "", "error_m": 0.01, "verified": 9, "refuted": 0, "not_testable": 1,
        "false_accepts": 0, "collisions": 0, "relocations": 0, "robot_s": 60.0, "wall_s": 4.0}
    return LightResult(trial.kind, trial.floor, **(values | other))


def report(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, work: Callable[[LightTrial], LightResult], **how: Any
) -> Any:
    monkeypatch.setattr(light, "draw_sheet", lambda path: path.touch())
    return run_here(monkeypatch, tmp_path, light, work, **how)


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_every_kind_of_light_is_drawn_the_same_again_and_read(tmp_path: Path, kind: LightKind) -> None:
    path = write_light_mission(tmp_path, LightTrial(kind, 4))
    found = load_scenario(path).light
    values = draw_light(kind, 4)
    if values is None:
        assert kind == "flat" and found is None
    else:
        assert found == Lighting(**{key: tuple(v) if isinstance(v, list) else v for key, v in values.items()})


def test_flawless_missions_hold_every_claim(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = report(monkeypatch, tmp_path, end, quick=False)
    assert found.failing == ()
    assert sum(row[3] for row in found.rows) == 1_000


@pytest.mark.parametrize(("flaw", "told"), [({"outcome": "lost"}, "reach"), ({"false_accepts": 1}, "no milestone")])
def test_a_flaw_under_light_fails_its_claim(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flaw: dict[str, Any], told: str
) -> None:
    found = report(monkeypatch, tmp_path, lambda t: end(t, **flaw if t.kind == "sun" else {}), quick=False, missions=30)
    assert any(told in claim for claim in found.failing)


@pytest.mark.slow
def test_the_small_version_drives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = report(monkeypatch, tmp_path, run_light_mission, quick=True)
    assert found.holds, found.text()
    assert sum(row[3] for row in found.rows) == len(light.QUICK_KINDS)
