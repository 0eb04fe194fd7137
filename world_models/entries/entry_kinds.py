"""All kinds of entries that come with the project; a knowledge source of another package brings its own."""

from blackboard import kinds_in
from world_models import obstruction
from world_models.building import locale_frame
from world_models.entries import (
    body,
    difference,
    discrepancy,
    door_state,
    floor,
    location,
    obstacle,
    percepts,
    robot_state,
    task,
)

KINDS = kinds_in(
    locale_frame, robot_state, body, task, percepts, location, obstacle, obstruction, floor, door_state,
    difference, discrepancy)
