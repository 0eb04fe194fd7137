"""Settings of lines, regions, corners and template correlation (§1.2)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_RENDERED = "measured on rendered edges (tests/laws/features)"


@dataclass(frozen=True, slots=True)
class FeaturesSettings:
    """The numbers of lines, regions, corners and template correlation (§1.2)."""

    # Line segments, whether predicted or not
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

    # Segments near predicted lines: bands
    band_px: float = setting(
        12.0, "px", "Half-width of the band searched round a predicted line, also beyond its ends.", "§6.1.4, Figure 1")

    # Regions of like brightness
    max_valley_share: float = setting(
        0.6, "1", "Largest height of a histogram's valley as a share of the lower of its two peaks.", _JUDGED)
    min_mode_share: float = setting(
        0.02, "1", "Least share of a sector's pixels on each side of a valley.", _JUDGED)
