"""What lies on the blackboard, one file a family; each kind says here what it is, how long it stays, and its sentence.

``body``: requests to the robot's body and its answers. ``task``: command, goal, plan sketch, leg, milestone,
certificate, outcome. ``percepts``: tracks, segments, matches, pose fixes. ``location``: pose hypotheses. ``wheels``,
``obstruction``: what is learnt of the wheels, and what stands before the camera.
"""

from blackboard.kinds import kinds_in
from world_models.entries import body, location, obstruction, percepts, task, wheels

KINDS = kinds_in(body, task, percepts, location, wheels, obstruction)
"""All kinds of entries that come with the project; a knowledge source of another package brings its own."""
