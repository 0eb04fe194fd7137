"""Entity paths: lower-case nouns in the order of the data's flow. The blueprint and the loggers meet here only."""

from __future__ import annotations

DESCRIPTION = "description"

WORLD = "world"
BUILDING = f"{WORLD}/building"
FLOORS, WALLS, THINGS = f"{BUILDING}/floors", f"{BUILDING}/walls", f"{BUILDING}/things"
NAMES, DOORWAYS = f"{BUILDING}/names", f"{BUILDING}/doorways"
TRUE_ROBOT, TRUE_TRAIL = f"{WORLD}/robot/true", f"{WORLD}/robot/true_trail"
BELIEVED_ROBOT, BELIEVED_TRAIL = f"{WORLD}/robot/believed", f"{WORLD}/robot/believed_trail"
CANDIDATES = f"{WORLD}/robot/candidates"
GOAL, PATH, LEG, LANDMARKS = f"{WORLD}/plan/goal", f"{WORLD}/plan/path", f"{WORLD}/plan/leg", f"{WORLD}/plan/landmarks"

CAMERA = "camera"
IMAGE = f"{CAMERA}/image"
EXPECTED, SEGMENTS, MATCHED = f"{IMAGE}/expected", f"{IMAGE}/segments", f"{IMAGE}/matched"
WINDOWS, DRIFTS = f"{IMAGE}/windows", f"{IMAGE}/drifts"

SKETCH = "sketch"
LANES = "lanes"
FOCUS = f"{LANES}/focus"
WHY = "why"

DECISION = "decision"
TABLE, RECORDS = f"{DECISION}/table", f"{DECISION}/records"

ERRORS = "errors"
POSITION, HEADING, DEVIATION = f"{ERRORS}/position", f"{ERRORS}/heading", f"{ERRORS}/deviation"
