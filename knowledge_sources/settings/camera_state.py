"""Settings of the camera's own state: how well it is known at first, and how it is learnt from milestones."""

from __future__ import annotations

import math
from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_MOUNTED = "issue: mounted by hand, up to 3 degrees and 8 cm otherwise than believed, taken for two deviations"


@dataclass(frozen=True, slots=True)
class CameraStateSettings:
    """The numbers of the camera's own state."""

    # What is believed where nobody has stated a deviation
    sigma_tilt_rad: float = setting(math.radians(1.5), "rad", "Standard deviation of the mounting's tilt.", _MOUNTED)
    sigma_roll_rad: float = setting(math.radians(1.5), "rad", "Standard deviation of its roll.", _MOUNTED)
    sigma_yaw_rad: float = setting(math.radians(1.5), "rad", "Standard deviation of its yaw.", _MOUNTED)
    sigma_height_m: float = setting(0.04, "m", "Standard deviation of its height.", _MOUNTED)
    sigma_focal: float = setting(
        0.02, "1", "Standard deviation of the focal length, as a part of it.", "issue: up to 4 %")
    sigma_centre_px: float = setting(
        0.5, "px", "Standard deviation of the principal point, along each axis.", "harvey experiment calibrate")

    # Where it is matched
    max_known_px: float = setting(
        4.0, "px", "Up to this uncertainty in the picture the camera is taken as believed when lines are matched.",
        _JUDGED)
    focal_starts: tuple[float, ...] = setting(
        (-1.5, 0.0, 1.5), "1", "Focal lengths that are tried beyond it, in deviations.", _JUDGED)
    pair_px: float = setting(8.0, "px", "Largest distance of a data end from its model line then.", _JUDGED)
    match_sigma_px: float = setting(2.5, "px", "Standard deviation of a data end across its model line then.", _JUDGED)
    sharp_px: float = setting(1.0, "px", "A line is covered sharply by segments within this distance.", _JUDGED)

    # A camera that was knocked
    min_sharp_part: float = setting(
        0.6, "1", "Where less of the lines' length is covered sharply, the camera may have been knocked.", _JUDGED)
    min_knock_gain: float = setting(
        0.15, "1", "By so much more must be covered sharply with a camera that was knocked.", _JUDGED)

    # The yaw, from where the robot comes to
    min_travel_m: float = setting(1.0, "m", "Shortest way by which the yaw is learnt.", _JUDGED)
    max_travel_m: float = setting(15.0, "m", "A longer way is not measured: what the wheels slip adds up.", _JUDGED)
    min_straightness: float = setting(
        0.9, "1", "Part of the way's length that its ends are apart; of a more bent one nothing is learnt.", _JUDGED)
    heading_sigma_rad: float = setting(
        math.radians(0.5), "rad", "Standard deviation of the headings on a way of one metre; they average.",
        "missions with cameras as told, generated floors 3 to 8")
    max_yaw_sigmas: float = setting(
        3.0, "1", "A way that ends further aside than this tells nothing of the yaw.", _JUDGED)
    min_learnt: float = setting(0.05, "1", "The yaw is revised when its variance shrinks by this part.", _JUDGED)

    # What is learnt
    min_lines: int = setting(10, "count", "Fewest lines by which the camera is learnt.", _JUDGED)
    max_chi2: float = setting(
        30.0, "1", "Squared distance from what was believed beyond which a picture is no evidence.", _JUDGED)
    min_move_m: float = setting(
        0.3, "m", "A picture counts if it was taken this far from those that have counted.", _JUDGED)
    min_turn_rad: float = setting(math.radians(10.0), "rad", "Or in a direction that differs by this.", _JUDGED)
    counted: int = setting(40, "count", "Number of pictures that are remembered as counted.", _JUDGED)
    floor_rad: float = setting(
        math.radians(0.02), "rad", "Tilt, roll and yaw are never known better: lines share errors.", _JUDGED)
    floor_m: float = setting(0.0015, "m", "Nor the height.", _JUDGED)
    floor_focal: float = setting(0.001, "1", "Nor the focal length.", _JUDGED)
    floor_centre_px: float = setting(0.2, "px", "Nor the principal point.", _JUDGED)

    # The pose and the camera from one picture
    widths_px: tuple[float, ...] = setting(
        (24.0, 12.0, 6.0, 3.0, 1.5), "px", "Widths of the loss by which pose and camera are refined.", _JUDGED)
    steps_a_width: int = setting(2, "count", "Steps of Gauss-Newton at each width.", _JUDGED)
    outlier_sigmas: float = setting(3.0, "1", "A line further off than this is an outlier.", _JUDGED)
    max_rounds: int = setting(8, "count", "Most rounds of choosing the lines that agree.", _JUDGED)
    min_freedom: int = setting(6, "count", "Fewest degrees of freedom by which the noise is judged.", _JUDGED)
    line_sigma_px: float = setting(
        0.5, "px", "Standard deviation of a line's end across it, with what model and picture have in common.", _JUDGED)
