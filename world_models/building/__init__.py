"""What is the building like (§3.4)? Locales, what bounds them, what stands in them, and how one gets about.

In reading order:

* :mod:`.geometry`: faces with regions, landmarks, solids and outlines: shapes and colors.
* :mod:`.locales`: locales, what stands in them, doorways, links (elevators and stairs), and where locales lie.
* :mod:`.changes`: what is believed otherwise than the world file says: a door found shut, a thing gone.
* :mod:`.passages`: passage graphs at every level of the hierarchy, and routes.
* :mod:`.locale_frame`: all that is known of one locale: the unit in which a building is asked, told and changed.
* :mod:`.building`: the queries, one locale at a time; :mod:`.world`: the whole, as files and the simulator have it.
* :mod:`.model_errors`: how well the model knows where things are, and which errors are shared.
* :mod:`.checks`: faults of a world.
* :mod:`.plan_view`: a floor plan as a drawing.
"""

from world_models.building.building import Building
from world_models.building.changes import element_names
from world_models.building.checks import Watched, check_world, pass_on
from world_models.building.locale_frame import (
    CHANGED, FRAME_OF, FrameChange, FrameReference, FrameRequest, LocaleFrame, UNDONE, has_answer,
)
from world_models.building.locales import Doorway, EXTRA_KIND, Link, Passage, ROBOT_TOP_M, STEP_M, Thing
from world_models.building.model_errors import LineErrors, find_line_errors, pack_errors
from world_models.building.passages import Route
from world_models.building.plan_view import (
    Drawing, DrawnStorey, GROUND, SCALE, build_drawing, draw_storeys, drawing_svg, find_storeys, plan_svg,
)
from world_models.building.world import World

__all__ = [
    "CHANGED", "EXTRA_KIND", "FRAME_OF", "GROUND", "ROBOT_TOP_M", "SCALE", "STEP_M", "UNDONE", "Building", "Doorway",
    "Drawing", "DrawnStorey", "FrameChange", "FrameReference", "FrameRequest", "LineErrors", "Link", "LocaleFrame",
    "Passage", "Route", "Thing", "Watched", "World", "build_drawing", "check_world", "draw_storeys", "drawing_svg",
    "element_names", "find_line_errors", "find_storeys", "has_answer", "pack_errors", "pass_on", "plan_svg",
]
