"""Entity paths: lower-case nouns in the order of the data's flow. The blueprint and the loggers meet here only."""

from __future__ import annotations

DESCRIPTION = "description"

WORLD = "world"
BUILDING = f"{WORLD}/building"
NAMES, DOORWAYS = f"{BUILDING}/names", f"{BUILDING}/doorways"
TRUE_ROBOT, TRUE_TRAIL = f"{WORLD}/robot/true", f"{WORLD}/robot/true_trail"
BELIEVED_ROBOT, BELIEVED_TRAIL = f"{WORLD}/robot/believed", f"{WORLD}/robot/believed_trail"
BELIEVED_BODY = f"{BELIEVED_ROBOT}/body"
TRUE_ADDED, TRUE_GONE = f"{WORLD}/truth/added", f"{WORLD}/truth/gone"
CANDIDATES = f"{WORLD}/robot/candidates"
CONTACTS, RANGES = f"{WORLD}/robot/contacts", f"{BELIEVED_ROBOT}/ranges"
GOAL, PATH, LEG, LANDMARKS = f"{WORLD}/plan/goal", f"{WORLD}/plan/path", f"{WORLD}/plan/leg", f"{WORLD}/plan/landmarks"
SEEN_FLOOR, OBSTACLES, DOORS = f"{WORLD}/seen/floor", f"{WORLD}/seen/obstacles", f"{WORLD}/seen/doors"
FRAMES, FRAME_LIST = f"{WORLD}/frames", "frames"

CAMERA = "camera"
IMAGE = f"{CAMERA}/image"
EXPECTED, SEGMENTS, MATCHED = f"{IMAGE}/expected", f"{IMAGE}/segments", f"{IMAGE}/matched"
REJECTED, LANDMARK_NAMES = f"{IMAGE}/rejected", f"{IMAGE}/names"
WINDOWS, DRIFTS = f"{IMAGE}/windows", f"{IMAGE}/drifts"
OBSTRUCTION = f"{IMAGE}/obstruction"
FREE_IN_PICTURE, FLOOR_BOUNDARY, THINGS = f"{IMAGE}/floor/free", f"{IMAGE}/floor/boundary", f"{IMAGE}/floor/things"
DOOR_IN_PICTURE = f"{IMAGE}/door"
WAITING = f"{CAMERA}/waiting"

SKETCH = "sketch"

HARVEY, FOCUS, FAULTS = "Activity", "Active_level", "Alarm"
"""Lanes are labelled with their whole path and sorted by it: these come before most of who acts, by level."""

WHY = "why"
CHAPTERS = "chapters"

DECISION = "decision"
TABLE, RECORDS = f"{DECISION}/table", f"{DECISION}/records"

ERRORS = "errors"
POSITION, HEADING, DEVIATION = f"{ERRORS}/position", f"{ERRORS}/heading", f"{ERRORS}/deviation"

SUMMARY, MOODS_OF, MILESTONES, OFF, FLEET = "summary", "run", "milestones", "off", f"{WORLD}/fleet"
"""Of the overview of several runs: each has one entity a run below it, but the summary."""
