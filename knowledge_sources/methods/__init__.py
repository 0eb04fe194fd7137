"""How: arrays in, arrays out, no blackboard. One folder a question.

``features`` (what is in a picture?), ``pose`` (where is the camera, given matches?), ``matching`` (which line is
which?), ``tracking`` (where did a landmark move?), ``verification`` (is the robot there?), ``localization`` (where
could it be?), ``motion`` (how does it get there?), ``doors`` (is a door open?), ``calibration`` (what is
the camera?).
"""
