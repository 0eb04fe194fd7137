"""Every number that can be set, one frozen dataclass for each room; ``harvey settings`` prints them.

A function takes the settings of its own room, or :class:`Settings` where it also calls other rooms.
"""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.action import ActionSettings
from knowledge_sources.settings.calibration import CalibrationSettings
from knowledge_sources.settings.features import FeaturesSettings
from knowledge_sources.settings.goal import GoalSettings
from knowledge_sources.settings.localization import LocalizationSettings
from knowledge_sources.settings.matching import MatchingSettings
from knowledge_sources.settings.motion import MotionSettings
from knowledge_sources.settings.plan import PlanSettings
from knowledge_sources.settings.pose import PoseSettings
from knowledge_sources.settings.tracking import TrackingSettings
from knowledge_sources.settings.verification import VerificationSettings


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of all rooms."""

    features: FeaturesSettings = FeaturesSettings()
    pose: PoseSettings = PoseSettings()
    matching: MatchingSettings = MatchingSettings()
    verification: VerificationSettings = VerificationSettings()
    localization: LocalizationSettings = LocalizationSettings()
    tracking: TrackingSettings = TrackingSettings()
    motion: MotionSettings = MotionSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    action: ActionSettings = ActionSettings()
    plan: PlanSettings = PlanSettings()
    goal: GoalSettings = GoalSettings()


DEFAULT = Settings()
"""What holds unless somebody sets it otherwise."""
