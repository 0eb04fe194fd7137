"""Settings of lines, regions, corners and template correlation (§1.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_RENDERED = "measured on rendered edges (tests/laws/features)"


@dataclass(frozen=True, slots=True)
class FeaturesSettings:
    """The numbers of lines, regions, corners and template correlation (§1.2)."""

    noise_rows: int = setting(64, "count", "Rows of an image, about, on which its pixel noise is estimated.", _JUDGED)

    # Line segments, whether predicted or not
    edge_smoothing_px: float = setting(
        0.8, "px", "Standard deviation of the Gaussian smoothing before an edge is located.",
        "engineering judgement; the phase-bias table of lines.py was computed for it")
    edge_profile_px: float = setting(
        1.1, "px", "Standard deviation of a sharp edge's gradient profile after smoothing and differencing.", _RENDERED)
    min_gradient_sigmas: float = setting(
        4.0, "1", "Least gradient of an edge pixel, in standard deviations of the gradient of pure noise.", _JUDGED)
    min_edge_density: float = setting(
        0.6, "1", "Least share of a segment's length that has an edge pixel.", _JUDGED)
    min_line_length_px: float = setting(8.0, "px", "Least length of a segment.", "§6.1.4")
    min_line_contrast: float = setting(
        2.0, "grey levels", "Least brightness step across a segment.", _JUDGED)
    min_line_support: float = setting(
        0.5, "1", "Least share of a segment's samples that lie on its refined line.", _JUDGED)
    line_systematic_px: float = setting(
        0.03, "px", "Error of a segment's place that does not average out along it, added in quadrature.",
        "measured: a lens not quite known, a renderer that places edges to a sixteenth of a pixel")
    sigma_along_px: float = setting(
        0.7, "px", "Standard deviation of a segment's end along the segment.", "measured on rendered corners")
    sigma_across_px: float = setting(
        0.7, "px", "Standard deviation of a segment's end across its model line, with the model's own errors.",
        _RENDERED)
    max_duplicate_offset_px: float = setting(
        0.7, "px", "Largest distance across at which a segment repeats a longer one.", _JUDGED)
    max_duplicate_overhang_px: float = setting(
        3.0, "px", "Largest distance beyond the ends at which a segment repeats a longer one.", _JUDGED)

    # Segments of the whole image: line-support regions
    min_gradient_per_px: float = setting(
        4.0, "grey levels/px", "Least gradient of an edge pixel when the whole image is searched.", _JUDGED)
    max_region_turn_rad: float = setting(
        math.radians(22.5), "rad", "Largest angle between a pixel's gradient and the mean of its line-support region.",
        "Burns et al. 1986; Grompone von Gioi et al. 2012")
    region_gap_px: int = setting(
        2, "px", "Distance of edge pixels that may still belong to one line-support region.", _JUDGED)
    max_region_bend_px: float = setting(
        0.6, "px", "Largest RMS distance of a region's pixels from its line before it is cut in two.", _JUDGED)
    region_end_px: float = setting(
        1.5, "px", "Distance by which an edge reaches beyond its last edge pixel.", "measured on rendered corners")

    # Segments near predicted lines: bands
    band_px: float = setting(
        12.0, "px", "Half-width of the band searched round a predicted line, also beyond its ends.", "§6.1.4, Figure 1")
    max_band_turn_rad: float = setting(
        0.3, "rad", "Largest angle between a segment and the predicted line.", _JUDGED)
    band_smoothing_along_px: float = setting(
        2.0, "px", "Standard deviation of the smoothing of a band along the predicted line.", _JUDGED)
    band_smoothing_across_px: float = setting(
        1.0, "px", "Standard deviation of the smoothing of a band across the predicted line.", _JUDGED)
    min_band_gradient_per_px: float = setting(
        0.5, "grey levels/px", "Least gradient of an edge in a band, however little noise there is.", _JUDGED)
    chain_gap_px: int = setting(
        2, "px", "Half the gap over which gradient peaks of a band are joined to one chain.", _JUDGED)
    chain_scale_px: float = setting(
        0.5, "px", "Scale of the Geman-McClure weights of the line fit to a chain.", _JUDGED)
    chain_iterations: int = setting(3, "count", "Reweighting steps of the line fit to a chain.", _JUDGED)
    max_chain_residual_px: float = setting(
        1.0, "px", "Largest distance of a peak from the line of its chain.", _JUDGED)

    # Sub-pixel refinement of segments
    sample_spacing_px: float = setting(
        2.0, "px", "Distance of the places along a segment at which the edge is located.", _JUDGED)
    min_samples: int = setting(5, "count", "Least number of such places on a segment.", _JUDGED)
    refinement_reach_px: int = setting(
        2, "px", "Distance across a rough segment up to which its edge is looked for.", _JUDGED)
    min_end_gradient_share: float = setting(
        0.35, "1", "Least gradient within the ends of an edge, as a share of the strongest within two samples.",
        "measured on rendered corners")
    peak_floor_px: float = setting(
        0.03, "px", "Error of a single gradient peak that remains without noise.", _RENDERED)
    peak_correlation: float = setting(
        2.0, "1", "Variance of a mean of neighbouring peaks over that of independent ones.", _RENDERED)
    prior_peaks: float = setting(
        4.0, "count", "Number of peaks for which the predicted scatter counts beside the measured one.", _JUDGED)

    # Template correlation
    alignment_steps: int = setting(2, "count", "Gauss-Newton steps of the sub-pixel alignment.", _JUDGED)
    gradient_leak: float = setting(
        3e-4, "1", "Share of an edge's gradient energy that seems to lie along it.", _RENDERED)
    position_floor_px: float = setting(
        0.02, "px", "Error of an aligned position that remains without noise.", _RENDERED)
    peak_lobe_px: int = setting(
        2, "px", "Distance from the best place up to which a local maximum is the same peak.", _JUDGED)

    # Regions of like brightness
    histogram_bins: int = setting(64, "count", "Bins of a sector's histogram of grey levels.", _JUDGED)
    max_valley_share: float = setting(
        0.6, "1", "Largest height of a histogram's valley as a share of the lower of its two peaks.", _JUDGED)
    min_mode_share: float = setting(
        0.02, "1", "Least share of a sector's pixels on each side of a valley.", _JUDGED)
    max_border_step: float = setting(
        12.0, "grey levels", "Largest step across a sector's border between parts that are joined.", _JUDGED)

    # Direction of level lines (Manhattan world)
    direction_bins: int = setting(90, "count", "Bins of the histogram of directions over a right angle.", _JUDGED)
    max_upright_cosine: float = setting(
        0.985, "1", "Largest cosine between a segment's rays and the vertical before it counts as upright.", _JUDGED)
    min_normal_level: float = setting(
        0.15, "1", "Least level part of the unit normal of a segment's plane through the camera.", _JUDGED)
    min_eye_slope: float = setting(
        0.06, "1", "Least slope of a segment's rays: lines at the height of the camera look alike.", _JUDGED)
    max_vote_length_px: float = setting(
        150.0, "px", "Length beyond which a segment's vote for a direction does not grow.", _JUDGED)
    max_direction_spread_rad: float = setting(
        math.radians(3.0), "rad", "Largest angle from the best bin at which segments share its direction.", _JUDGED)
    min_direction_segments: int = setting(
        4, "count", "Least number of segments that share a direction: two or three marks on a bare wall may do so.",
        "experiment kidnap")
