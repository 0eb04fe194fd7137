"""Settings of the knowledge sources of the goal level (§2)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class GoalSettings:
    """The numbers of the knowledge sources of the goal level (§2)."""

    # Relocalizer
    max_far_probes: int = setting(
        20, "count", "So many looks are taken when lost and places fit: it turns, and drives to views that tell them"
        " apart.", "engineering judgement")
    max_rooms: int = setting(
        80, "count", "Most rooms that are searched, the nearest to the last belief first.", "engineering judgement")
    max_floor_difference_m: float = setting(
        0.5, "m", "Rooms whose floors differ by less are on one floor.", "engineering judgement")
    min_contrast: float = setting(
        6.0, "grey levels", "A dark frame has less contrast (standard deviation of its grey values) than this.",
        "engineering judgement")
    min_brightness: float = setting(
        40.0, "grey levels", "A dark frame also has a lower mean than this; a brighter one shows a bare wall.",
        "engineering judgement")
