"""Settings of camera calibration."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_CONVERGED = "convergence limit; results do not depend on it"


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """The numbers of camera calibration."""

    min_square_px: float = setting(
        5.0, "px", "Least side of a chessboard's square in a picture that is used.", _JUDGED)
    max_edge_rise_px: float = setting(
        5.0, "px", "Largest width of the rise from black to white before a picture counts as blurred.", _JUDGED)
    corner_window_share: float = setting(
        0.4, "1", "Half-width of the window of corner refinement as a share of the distance to the next corner.",
        "rendered boards: 0.048 px RMS with 3 px, 0.035 px with 8 px")
    max_corner_window_px: int = setting(11, "px", "Largest half-width of that window.", _JUDGED)
    corner_iterations: int = setting(60, "count", "Iteration limit of corner refinement.", _CONVERGED)
    corner_tolerance_px: float = setting(1e-4, "px", "Step at which corner refinement ends.", _CONVERGED)
    min_views: int = setting(4, "count", "Least number of views of the board.", "Zhang 2000")
    max_view_rms_ratio: float = setting(
        3.0, "1", "Largest RMS error of a view over that of the median view before it is left out.", _JUDGED)
    calibration_iterations: int = setting(100, "count", "Iteration limit of the calibration.", _CONVERGED)
    calibration_tolerance: float = setting(1e-10, "1", "Relative step at which the calibration ends.", _CONVERGED)
    max_tilt_rad: float = setting(
        1.55, "rad", "Largest tilt of a camera before the view of its mounting board is refused.", _JUDGED)
    max_roll_rad: float = setting(
        0.8, "rad", "Largest roll of a camera before the view of its mounting board is refused.", _JUDGED)
