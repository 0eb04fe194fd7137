"""Is the robot at this pose? Evidence from a picture, and the probability that the pose is wrong.

In reading order:

* :mod:`predicted_lines`: the model lines that should be visible from a pose.
* :mod:`agreement`: how many of them segments cover, against how many would be covered by chance (a contrario).
* :mod:`line_check`: the same for a pose of the robot.
* :mod:`color_check`: whether the faces in view have the model's colors, relative to each other.
* :mod:`pose_evidence`: both checks, and the distance from the belief, as eight numbers.
* :mod:`pose_confidence`: logistic regression of these numbers to the probability of a wrong pose
  (``verification_weights.toml``, fitted by ``harvey experiment milestones-calibrate``).

About a pose that is not reached yet:

* :mod:`view_quality`: how precise a pose would be, by the information matrix of the predicted lines.
"""
