"""Settings: each has unit, meaning and source; setting one changes it and nothing else; mistakes are named."""

from __future__ import annotations

import ast
import json
import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from harvey.agent_settings import build_settings, names
from harvey.cli import main
from harvey.commands.settings import format_value
from harvey.errors import BadInput
from harvey.robot_settings import list_robot_rows
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.table import Row, list_rows, replace_value
from world_models.entries.body import LAST_REQUESTS
from world_models.entries.percepts import LAST_SEGMENTS

ROWS, ROBOT_ROWS = list_rows(), list_robot_rows()
UNITS = {"px", "m", "rad", "s", "m/s", "rad/s", "1", "count", "1/m", "grey levels", "grey levels/px", "name", "yes/no"}
FOLDER = Path(__file__).parents[3] / "knowledge_sources"
WORDS = {word for path in FOLDER.rglob("*.py") if path.parent.name != "settings"
         for word in re.findall(r"\w+", path.read_text(encoding="utf-8"))}
each_row = pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])


def numbers(settings: Settings) -> dict[str, Any]:
    """Every field of every room, read from the dataclasses themselves."""
    rooms = {f.name: getattr(settings, f.name) for f in fields(settings)}
    return {f"{name}.{f.name}": getattr(room, f.name) for name, room in rooms.items() for f in fields(room)}


def another(row: Row) -> Any:
    """Another value of the same kind."""
    value: Any = row.value
    if row.choices:
        return next(choice for choice in row.choices if choice != value)
    if isinstance(value, bool):
        return not value
    if isinstance(value, tuple):
        return (*value[:-1], value[-1] + 1.0)
    if value + 1 <= row.most:
        return value + 1
    return value - 1 if isinstance(value, int) else 0.5 * value


def test_the_table_has_every_field_of_every_room() -> None:
    assert len(ROWS) > 80
    assert {row.name: row.value for row in ROWS} == numbers(DEFAULT)
    assert all(is_dataclass(getattr(DEFAULT, f.name)) for f in fields(DEFAULT))


@each_row
def test_each_has_a_unit_a_meaning_and_a_source(row: Row) -> None:
    assert row.unit in UNITS
    assert len(row.what.split()) >= 3 and row.what.endswith(".") and row.what[0].isupper()
    assert row.source
    kind = next(f.type for f in fields(getattr(DEFAULT, row.room)) if f.name == row.field)
    assert kind == {tuple: "tuple[float, ...]"}.get(type(row.value), type(row.value).__name__)
    assert isinstance(row.value, str) == bool(row.choices) and (not row.choices or row.value in row.choices)


@each_row
def test_each_is_read(row: Row) -> None:
    assert row.field in WORDS


@each_row
def test_setting_one_changes_it_and_nothing_else(row: Row) -> None:
    value = another(row)
    changed = replace_value(DEFAULT, row.name, value)
    assert numbers(changed) == {**numbers(DEFAULT), row.name: value}
    assert type(numbers(changed)[row.name]) is type(row.value)
    written = list(value) if isinstance(value, tuple) else str(value).lower()
    assert build_settings([(row.name, str(written))]) == changed


def test_no_more_is_asked_of_the_board_than_it_keeps() -> None:
    most = {row.name: row.most for row in ROWS}
    assert most["plan.max_obstruction_looks"] == LAST_SEGMENTS
    assert most["action.max_broken_motions"] == LAST_REQUESTS


def test_nothing_set_is_the_default() -> None:
    assert build_settings([]) == DEFAULT == Settings()


@pytest.mark.parametrize(("key", "value", "word"), [
    ("action.min_tolerence_px", "8", r"action\.min_tolerance_px.*harvey settings lists all"),
    ("tolerances.FLOOR_PX", "8", "expected one of"),
    ("action.min_tolerance_px", "off", "expected a number as 4, got 'off'"),
    ("action.min_tolerance_px", "nan", "expected a number"),
    ("action.min_tolerance_px", "inf", "expected a number"),
    ("action.max_misses", "2.5", "expected a whole number as 2, got '2.5'"),
    ("action.max_misses", "-1", "expected a whole number"),
    ("plan.clearances_m", "0.1", r"expected a list of numbers as \[0.12, 0.06, 0.03\]"),
    ("plan.max_obstruction_looks", "9", "expected 8 at most, got '9'"),
    ("matching.objective", "papre", "expected likelihood or paper, got 'papre'"),
    ("matching.exchange", "1", "expected on or off"),
    ("plan.clearances_m", "[]", "expected a list of numbers"),
])
def test_mistakes_are_named(key: str, value: str, word: str) -> None:
    with pytest.raises(BadInput, match=word):
        build_settings([(key, value)])


def test_no_setting_is_called_as_a_key_of_a_mission() -> None:
    """So --set knows which is meant."""
    from harvey.hardware.mission import FORMAT as HARDWARE
    from sim.scenario import FORMAT as SCENARIO

    assert not {*SCENARIO.keys(), *HARDWARE.keys()} & set(names())


EXCEPTIONS = {
    "a fact of geometry or mathematics": (
        "features/images.py: ROUNDING_SIGMA", "features/manhattan.py: RIGHT_ANGLE_RAD",
        "localization/next_view.py: HERE", "localization/pose_candidates.py: _NEIGHBORS",
        "matching/hough.py: NO_MOTION",
        "pose/med_r_and_t.py: MEDIAN_CHI2_2", "pose/med_r_and_t.py: SUBSET_SIZE",
        "pose/med_r_and_t.py: MAX_CHI2_6", "pose/numerics/finish.py: MIN_INLIERS",
        "pose/planar_from_points.py: MIN_POINTS", "pose/r_and_t.py: MIN_LINES", "pose/r_and_t.py: NO_INFORMATION",
        "verification/color_check.py: NOT_TESTED", "verification/pose_evidence.py: NEAR_M",
        "verification/predicted_colors.py: WHITE",
    ),
    "the shape of an array, or a flag of compiled code": (
        "localization/camera_matching.py: MOUNTING", "pose/with_camera.py: POSE",
        "features/line_bands.py: _MAP_WIDTH", "features/manhattan.py: _SMOOTHING", "matching/fit.py: POSE_STEP",
        "matching/kernels.py: RIGID", "matching/kernels.py: SCALED", "matching/kernels.py: STEP",
        "pose/numerics/kernels.py: FINE", "pose/numerics/kernels.py: IMAGE", "pose/numerics/kernels.py: NOT_FINITE",
        "pose/numerics/kernels.py: NO_LENGTH", "pose/numerics/kernels.py: PLANES",
        "verification/predicted_colors.py: MAX_CORNERS", "verification/predicted_colors.py: RAYS",
    ),
    "a table that was computed for one smoothing": (
        "features/line_refinement.py: _BENDS", "features/line_refinement.py: _SHIFT_PER_SKEW",
        "features/line_regions.py: _STEPS_PER_LEVEL", "features/correlation.py: _MARGIN_PX",
    ),
    "rounding: a guard against division by zero, or the end of a minimisation": (
        "localization/camera_matching.py: STEP", "pose/with_camera.py: STEPS", "pose/with_camera.py: TINY",
        "matching/hough.py: MIN_LENGTH_PX", "matching/kernels.py: NEWTON_STEPS", "matching/pose_pairs.py: TINY",
        "motion/footprints.py: GRAIN_M", "motion/footprints.py: MIN_SIDE_M", "motion/routes.py: CORNER_STEPS",
        "motion/routes.py: SLACK_M",
        "pose/numerics/finish.py: MIN_LENGTH_PX",
        "pose/numerics/kernels.py: MIN_IMAGE_PART", "pose/numerics/kernels.py: MIN_POINT_STEP",
        "pose/numerics/kernels.py: MIN_RELATIVE_GAIN", "pose/numerics/kernels.py: MIN_STEP",
        "motion/doorways.py: JOINT_M", "pose/numerics/kernels.py: TINY",
        "pose/numerics/levenberg_marquardt.py: MIN_RELATIVE_GAIN",
        "pose/numerics/levenberg_marquardt.py: MIN_STEP", "pose/planar_from_lines.py: NO_BOUND",
        "verification/view_quality.py: EPSILON_INFORMATION",
    ),
    "the size of a cache, on which no result depends": (
        "localization/far_views.py: MAX_FLOORS", "localization/visibility_map.py: MAX_MAPS",
        "motion/routes.py: MAX_FREE_SPACES", "motion/subgoals.py: MAX_FREE_PASSAGES",
        "tracking/template_tracking.py: MAX_TEMPLATES",
    ),
    "of methods that are new: those of them that somebody may want to tune become settings": (
        "doors/leaf.py: ALIKE_FOOT", "doors/leaf.py: FULL_FOOT", "doors/leaf.py: LEAST_UNIFORM",
        "doors/leaf.py: MAX_COMPARED", "doors/leaf.py: WEIGHTS", "doors/opening.py: OWN_SURFACE_M",
        "floor/appearance.py: DARK", "floor/appearance.py: ROUNDS", "floor/appearance.py: TRIM",
        "floor/floor_grid.py: STEP_PX", "floor/lookout.py: BORDER_PX", "floor/lookout.py: HEADINGS",
        "floor/lookout.py: MAX_FLOORS", "floor/lookout.py: MIN_DEPTH_M", "floor/model_floor.py: DEPTHS_M",
        "floor/model_floor.py: MIN_DEPTH_M", "floor/model_floor.py: MIN_UP", "floor/model_floor.py: STEP",
        "floor/parallax.py: COLUMNS", "floor/parallax.py: DEPTHS", "floor/parallax.py: HALF",
        "floor/parallax.py: MIN_DEVIATION", "floor/parallax.py: PLACES",
        "floor/see_floor.py: CUT_SIGMA_M", "floor/see_floor.py: DRIVEN_HALF_WIDTH_M",
        "floor/see_floor.py: GREY", "floor/see_floor.py: SIGHT_PART", "floor/seen_floor.py: HIDDEN_M",
        "floor/seen_floor.py: MIN_POINTS", "floor/seen_floor.py: SPACING_M", "floor/seen_floor.py: WINDOW_M",
        "floor/things.py: CUT_PART", "floor/things.py: MAX_STEP", "floor/things.py: MIN_ROWS",
        "motion/subgoals.py: MAX_ROUTES",
    ),
    "a drawing, or a place-holder": (
        "calibration/chessboard.py: _UNKNOWN_PX", "calibration/picture.py: CORNER", "calibration/picture.py: GRID",
        "calibration/picture.py: INK", "calibration/picture.py: RESIDUAL", "calibration/picture.py: RESIDUAL_PX",
        "calibration/picture.py: SIDE_PX",
    ),
}
"""Numbers that stand at the top of a module of methods, by why they are no settings."""


def stated_numbers(path: Path) -> set[str]:
    """The upper-case numbers that a module states at its top."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(
            node, ast.AnnAssign) else []
        value = getattr(node, "value", None)
        leaves = [leaf for target in targets for leaf in ast.walk(target) if isinstance(leaf, ast.Name)]
        if leaves and value is not None and any(
                isinstance(n, ast.Constant) and isinstance(n.value, int | float) and not isinstance(n.value, bool)
                for n in ast.walk(value)):
            found |= {leaf.id for leaf in leaves if leaf.id.strip("_").isupper()}
    return found


def test_no_tunable_number_is_stated_at_the_top_of_a_module() -> None:
    """A number that can be tuned is a setting."""
    files = [path for path in FOLDER.rglob("*.py") if path.parent.name != "settings"]
    stated = {f"{path.relative_to(FOLDER)}: {name}" for path in files for name in stated_numbers(path)}
    assert stated == {f"methods/{name}" for names in EXCEPTIONS.values() for name in names}


@each_row
def test_harvey_settings_prints_it(row: Row, capsys: pytest.CaptureFixture[str]) -> None:
    """By its room, by its name and in the record; with value, unit, meaning and source."""
    for name in (row.room, row.name):
        assert main(["settings", name]) == 0
        told = " ".join(capsys.readouterr().out.split())
        assert row.field in told
        assert " ".join(format_value(row).split()) in told
    assert main(["settings", row.name, "--json"]) == 0
    (record,) = json.loads(capsys.readouterr().out)
    value = list(row.value) if isinstance(row.value, tuple) else row.value
    assert record == {"name": row.name, "value": value, "unit": row.unit, "meaning": row.what, "source": row.source}


def test_harvey_settings_prints_all_within_the_terminals_width(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for width in (120, 160):
        monkeypatch.setenv("COLUMNS", str(width))
        assert main(["settings"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert max(map(len, lines)) <= width
        assert {line.split()[0] for line in lines if line.startswith("  ") and line[2] != " "} == {
            row.field for row in (*ROWS, *ROBOT_ROWS)}


def test_harvey_settings_names_near_rooms(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["settings", "matchin"]) == 2
    assert "matching" in capsys.readouterr().err
