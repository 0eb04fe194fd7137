"""Where is the robot, when its pose is unknown or in doubt? Four questions, each in reading order.

What was seen:

* :mod:`views`: views related by the motions between them; their turns corrected by level lines.
* :mod:`obstructions`: what is before the camera, and not in the building.

Where may the robot be?

* :mod:`visibility_map`: the points of model lines that are visible from each position of a room.
* :mod:`chamfer`: scores of many poses at once by oriented chamfer matching.
* :mod:`pose_candidates`: grid search over rooms, hill climbing, non-maximum suppression.
* :mod:`refinement`: from a candidate to a precise pose, by one Kalman update for each view.
* :mod:`log_likelihood`: how likely all views are at a pose, and whether that is enough to accept it.

Which of these poses is it, and what to look at next?

* :mod:`hypotheses`: weights of poses, and whether predicted views can be told apart.
* :mod:`next_view`: the turn or move whose view separates the hypotheses best (active localization).
* :mod:`global_localization`: all of the above: found, look again, or ambiguous.
* :mod:`place_odds`: where it was told to be, or was tracked to, as prior odds.

Could a known pose be another one that looks the same?

* :mod:`repetition`: where the floor plan repeats itself.
* :mod:`aliasing`: the pose of the room that is hardest to tell from a known one.
"""
