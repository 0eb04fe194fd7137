"""All kinds of entries that come with the project; a knowledge source of another package brings its own."""

from blackboard.kinds import kinds_in
from world_models.building import locale_frame
from world_models.entries import (
    body,
    door_state,
    floor,
    location,
    obstacle,
    obstruction,
    percepts,
    robot,
    task,
    told,
    touch,
    travel,
)

KINDS = kinds_in(locale_frame, told, robot, body, touch, task, percepts, location, obstacle, obstruction, floor,
                 door_state, travel)
