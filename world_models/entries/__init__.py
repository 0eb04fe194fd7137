"""What lies on the blackboard, one file a family; each kind says here what it is, how long it stays, and its sentence.

``locale_frame``: what is known of the building, one locale at a time, and the requests that bring it.
``robot_state``: what the robot knows of its camera, wheels and footprint, and what of the camera was believed
wrongly. ``body``: requests to the robot's body and its answers. ``task``: command, goal, plan sketch, leg, milestone,
certificate, outcome. ``percepts``: tracks, segments, matches, pose fixes. ``user_reports``: what somebody says on the
way. ``location``: pose hypotheses, and the way since a known place. ``obstacle``: contacts and ranges, what stands in
the way, what stands before the camera. ``floor``: free floor, and what floors look like. ``door_state``: which doors
are seen open or shut. ``entry_kinds``: all of them.
"""
