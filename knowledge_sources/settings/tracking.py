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
    max_landmark_distance_m: float = setting(15.0, "m", "Largest distance of a landmark when it is chosen.", _JUDGED)

    # Alignment to the model's edges
    min_edge_lines: int = setting(6, "count", "Least number of lines that must agree with the fit.", _JUDGED)
