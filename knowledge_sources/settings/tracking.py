"""Settings of following landmarks from frame to frame (§5)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_TABLE1 = "experiment table1"


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """The numbers of following landmarks from frame to frame (§5)."""

    # Template tracking
    template_half_px: int = setting(10, "px", "Half-width of a landmark's template.", _TABLE1)
    max_tracks: int = setting(14, "count", "Largest number of landmarks followed at a time.", _TABLE1)
    min_spacing_px: float = setting(28.0, "px", "Least distance in the picture between landmarks.", _JUDGED)
    min_landmark_contrast: float = setting(0.08, "1", "Least contrast of a model point that may be followed.", _JUDGED)
    max_landmark_distance_m: float = setting(15.0, "m", "Largest distance of a landmark when it is chosen.", _JUDGED)
    min_corner_per_px: float = setting(
        3.0, "grey levels/px", "Least corner strength of a landmark's patch (Shi-Tomasi).", _JUDGED)
    max_second_peak: float = setting(
        0.8, "1", "Largest correlation of a landmark's patch with another place near it when it is chosen.", _JUDGED)
    second_peak_window_px: float = setting(
        14.0, "px", "Half-width of the window in which another such place is looked for.", _JUDGED)
    min_peak: float = setting(0.7, "1", "Least correlation of a template with the place where it is found.", _JUDGED)
    min_distinctiveness: float = setting(
        0.08, "1", "Least margin of that correlation over the one at the second best place.", _JUDGED)
    min_search_px: float = setting(6.0, "px", "Least half-width of the window searched for a template.", _JUDGED)
    max_search_px: float = setting(48.0, "px", "Largest half-width of the window searched for a template.", _JUDGED)
    search_sigmas: float = setting(
        4.0, "1", "Half-width of that window in standard deviations of the predicted place.", _JUDGED)
    search_margin_px: float = setting(2.0, "px", "What is added to that half-width.", _JUDGED)
    min_sigma_px: float = setting(
        0.3, "px", "Least standard deviation of a landmark's place, as the model's corner is not exactly the seen one.",
        _TABLE1)
    min_scale: float = setting(0.55, "1", "Least scale of a landmark's view against its template.", _JUDGED)
    max_scale: float = setting(1.8, "1", "Largest scale of a landmark's view against its template.", _JUDGED)

    # Alignment to the model's edges
    edge_smoothing_px: float = setting(
        1.0, "px", "Standard deviation of the smoothing before edges are located.", _JUDGED)
    edge_spacing_px: float = setting(
        8.0, "px", "Distance of the places along a model line at which its edge is looked for.",
        "Harris and Stennett 1990")
    edge_inset_px: float = setting(
        4.0, "px", "Distance from a line's ends within which no edge is looked for, as other lines disturb.", _JUDGED)
    first_edge_reach_px: float = setting(
        4.0, "px", "Distance across a line up to which its edge is looked for in the first round.", _JUDGED)
    last_edge_reach_px: float = setting(
        2.0, "px", "Distance across a line up to which its edge is looked for in the last round.", _JUDGED)
    edge_step_px: float = setting(0.5, "px", "Step of the search across a line.", _JUDGED)
    edge_gate_sigmas: float = setting(
        3.0, "1", "Standard deviations of a line's place that must lie within the reach.", _JUDGED)
    min_sure_share: float = setting(
        0.75, "1", "Least share of the places along lines that must pass this test in the first round.", _JUDGED)
    min_edge_gradient_per_px: float = setting(2.0, "grey levels/px", "Least gradient of an edge.", _JUDGED)
    max_second_edge_share: float = setting(
        0.6, "1", "Largest gradient of another edge within reach, as a share of the steepest.", _JUDGED)
    edge_sigma_px: float = setting(
        0.4, "px", "Standard deviation of an edge's place, the model's own errors included.", _TABLE1)
    edges_per_line: float = setting(
        3.0, "count", "Largest weight of one line in places, as its error is the same all along it.", _JUDGED)
    max_edge_residual_px: float = setting(
        1.2, "px", "Largest distance of an edge from its model line after the fit.", _JUDGED)
    prior_sigma_m: float = setting(
        0.02, "m", "Standard deviation added to the believed place, as templates err together.", _TABLE1)
    prior_sigma_rad: float = setting(
        0.01, "rad", "Standard deviation added to the believed heading, as templates err together.", _TABLE1)
    edge_iterations: int = setting(4, "count", "Steps of the reweighted least-squares fit.", _JUDGED)
    min_edge_lines: int = setting(6, "count", "Least number of lines that must agree with the fit.", _JUDGED)
    min_edge_line_share: float = setting(
        0.5, "1", "Least share of the lines with an edge near them that must agree with the fit.", _JUDGED)
