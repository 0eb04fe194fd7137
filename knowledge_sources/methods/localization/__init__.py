"""Where is the robot, when its pose is unknown or in doubt? In reading order.

What was seen:

* :mod:`views`: views related by the motions between them, and what is before the camera, and not in the building.

Where may the robot be?

* :mod:`pose_candidates`: oriented chamfer matching over rooms, hill climbing, non-maximum suppression.
* :mod:`refinement`: from a candidate to a precise pose, and how likely all views are there.

Which of these poses is it, and what to look at next?

* :mod:`next_view`: the turn, move or way whose view separates the hypotheses best (active localization).
* :mod:`global_localization`: all of the above: found, look again, or ambiguous.
* :mod:`place_odds`: where it was told to be, or was tracked to, as prior odds.

Could a known pose be another one that looks the same?

* :mod:`aliasing`: where the floor plan repeats itself; the pose of the room that is hardest to tell from a known one.
"""
