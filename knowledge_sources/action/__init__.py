"""Action (§5): the robot on the move, and the servo level that corrects every increment.

Read ``motor`` (an increment), ``path_follower`` (steering), ``dead_reckoner`` (what the wheels tell),
``landmark_chooser`` and ``correlator_tracker`` (what the camera tells meanwhile), ``elevator_rider`` and
``floor_changer`` (between storeys), ``fault_handler`` (a body that does not do as asked).
"""
