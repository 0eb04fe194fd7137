"""Which part of the building does a camera see (§3.4)?

In reading order:

* :mod:`.culling`: the locales in view through chains of doorways, each with a window of the image; what convex surfaces
  hide of segments and points (shadow volumes).
* :mod:`.lines_and_points`: visible model lines and landmark corners, from both.
"""

from world_models.visibility.culling import Window, find_visible_locales, image_window
from world_models.visibility.lines_and_points import VisibleLines, visible_lines, visible_points

__all__ = [
    "VisibleLines", "Window", "find_visible_locales", "image_window", "visible_lines", "visible_points",
]
