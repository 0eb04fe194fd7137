"""Is the robot at this pose? Evidence from a picture, and the probability that the pose is wrong.

In reading order:

* :mod:`line_check`: the model lines that should be visible from a pose, how many of them segments cover, against how
  many would be covered by chance (a contrario); and how precise a pose from these lines would be.
* :mod:`predicted_colors`: the faces that should be visible, and their colors.
* :mod:`color_check`: whether the faces in view have the model's colors, relative to each other.
* :mod:`pose_confidence`: both checks, and the distance from the belief, as eight numbers; logistic regression of these
  to the probability of a wrong pose (``verification_weights.toml``, fitted by ``harvey experiment
  milestones-calibrate``).
* :mod:`weigh`: all of it for one picture of a milestone, and the verdict by that place alone.
"""
