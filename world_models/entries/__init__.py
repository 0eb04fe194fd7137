"""What lies on the blackboard, one file a family; each kind says here what it is, how long it stays, and its sentence.

``locale_frame``: what is known of the building, one locale at a time, and the requests that bring it.
``robot_state``: what the robot knows of its camera, wheels and footprint, and what of the camera was believed
wrongly. ``body``: requests to the robot's body and its answers. ``task``: command, goal, plan sketch, leg, milestone,
certificate, outcome, and what somebody says on the way. ``percepts``: tracks, segments, matches, pose fixes.
``location``: pose hypotheses, how far off a pose may be at a stated risk, and the way since a known place.
``obstacle``: contacts and ranges, what stands in the way, occlusions of the lens. ``floor``: free floor, and what
floors look like. ``door_state``: which doors are seen open or shut. ``difference``: what is not as expected, and the
rivals that would explain it. ``discrepancy``: how far off, and the ladder of levels that correct it. ``entry_kinds``:
all of them; not part of this face, as frames stand with the building.
"""

from world_models.entries.body import (
    BodyFault, CameraPicture, Course, LAST_REPORTS, MotionReport, MotorCommand, Odometry, PictureRequest, Recovery,
    Ride, RideReport, STOP_KEY,
)
from world_models.entries.difference import Difference, Evidence, Explanation, MISLEADING, Rival, RivalKind, SENSES
from world_models.entries.discrepancy import Discrepancy, LADDER, OPEN, correct, last_escalated, open_or_measure
from world_models.entries.door_state import DoorCondition, DoorPicture, DoorState
from world_models.entries.floor import (
    FloorEnd, FloorThing, FloorView, FreeFloor, LAST_VIEWS, Light, Point,
)
from world_models.entries.location import (
    ALERT_LIMIT_M, Hypothesis, LocalePoses, Place, PlaceOdds, PlaceSearch, Protection, RISK, SHARED_SIGMA_M, Travel,
    Alias, AliasOdds, begin_travel, count_sigmas, covariance_tuple, diagonal, turn_about_camera,
)
from world_models.entries.obstacle import (
    AROUND_SIGMA_RAD, Contact, Corners, Obstacle, ObstacleStatus, Ranges, Sense,
)
from world_models.entries.percepts import Anchor, Glimpse, LineMatch, Panorama, PoseFix, Segments, Track, Tracks
from world_models.entries.robot_state import CameraLesson, CameraState, Drift, Footprint, Wheels, find_camera_lessons
from world_models.entries.task import (
    BELIEVED, Certificate, Command, DOOR_STATES, GO_ON, Goal, Impasse, KNOWN, Leg, Milestone, MilestoneVerdict,
    OTHERWISE, Outcome, PlanSketch, Redirection, Resumed, SketchStatus, Subgoal, UserReport,
)
from world_models.obstruction import Obstruction

__all__ = [
    "ALERT_LIMIT_M", "AROUND_SIGMA_RAD", "BELIEVED", "DOOR_STATES", "GO_ON", "KNOWN", "LADDER", "LAST_REPORTS",
    "LAST_VIEWS", "MISLEADING", "OPEN", "OTHERWISE", "RISK", "SENSES", "SHARED_SIGMA_M", "STOP_KEY", "Alias",
    "AliasOdds", "Anchor", "BodyFault", "CameraLesson", "CameraPicture", "CameraState", "Certificate", "Command",
    "Contact", "Corners", "Course", "Difference", "Discrepancy", "DoorCondition", "DoorPicture", "DoorState", "Drift",
    "Evidence", "Explanation", "FloorEnd", "FloorThing", "FloorView", "Footprint", "FreeFloor", "Glimpse", "Goal",
    "Hypothesis", "Impasse", "Leg", "Light", "LineMatch", "LocalePoses", "Milestone", "MilestoneVerdict",
    "MotionReport", "MotorCommand", "Obstacle", "ObstacleStatus", "Obstruction", "Odometry", "Outcome", "Panorama",
    "PictureRequest", "Place", "PlaceOdds", "PlaceSearch", "PlanSketch", "Point", "PoseFix", "Protection", "Ranges",
    "Recovery", "Redirection", "Resumed", "Ride", "RideReport", "Rival", "RivalKind", "Segments", "Sense",
    "SketchStatus", "Subgoal", "Track", "Tracks", "Travel", "UserReport", "Wheels", "begin_travel", "correct",
    "count_sigmas", "covariance_tuple", "diagonal", "find_camera_lessons", "last_escalated", "open_or_measure",
    "turn_about_camera",
]
