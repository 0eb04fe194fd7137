"""Every number that can be set, one frozen dataclass for each room; ``harvey settings`` prints them.

A function takes the settings of its own room, or :class:`Settings` where it also calls other rooms.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from knowledge_sources.settings.action import ActionSettings
from knowledge_sources.settings.camera_state import CameraStateSettings
from knowledge_sources.settings.features import FeaturesSettings
from knowledge_sources.settings.floor import FloorSettings
from knowledge_sources.settings.goal import GoalSettings
from knowledge_sources.settings.localization import LocalizationSettings
from knowledge_sources.settings.matching import MatchingSettings
from knowledge_sources.settings.plan import PlanSettings
from knowledge_sources.settings.pose import PoseSettings
from knowledge_sources.settings.tracking import TrackingSettings
from knowledge_sources.settings.verification import VerificationSettings


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of all rooms."""

    features: FeaturesSettings = field(default_factory=FeaturesSettings)
    pose: PoseSettings = field(default_factory=PoseSettings)
    matching: MatchingSettings = field(default_factory=MatchingSettings)
    verification: VerificationSettings = field(default_factory=VerificationSettings)
    localization: LocalizationSettings = field(default_factory=LocalizationSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    camera_state: CameraStateSettings = field(default_factory=CameraStateSettings)
    action: ActionSettings = field(default_factory=ActionSettings)
    plan: PlanSettings = field(default_factory=PlanSettings)
    goal: GoalSettings = field(default_factory=GoalSettings)
    floor: FloorSettings = field(default_factory=FloorSettings)


DEFAULT = Settings()
"""What holds unless somebody sets it otherwise."""
