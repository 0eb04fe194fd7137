"""Settings of the check of a pose: predicted lines, line and color checks, evidence."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_MILESTONES = "engineering judgement, checked with harvey experiment milestones"


@dataclass(frozen=True, slots=True)
class VerificationSettings:
    """The numbers by which a pose is checked against a picture."""

    # Predicted lines.
    min_line_length_px: float = setting(
        12.0, "px", "Shortest projected model line that is predicted.", _JUDGED)

    # Agreement of lines and segments, counted a contrario.
    line_tolerance_px: float = setting(
        2.5, "px", "Largest distance of a segment from the line that it covers.", _MILESTONES)
    min_matched_lines: int = setting(
        6, "count", "Fewest matched lines by which a milestone is testable.", _MILESTONES)

    # Evidence for a pose.
    motion_tolerance_sigmas: float = setting(
        4.0, "1", "Deviations that the wheels are allowed: of three numbers, one in a thousand lies further out.",
        "chi-square with three degrees of freedom")
