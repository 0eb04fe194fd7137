"""The simulated robot in its building.

In reading order: ``simulated_body`` (the robot: commands, pictures, time and faults), ``actuator`` (errors of the
wheels, §3.2), ``continuous_motion`` (a motion that is steered on the move), ``collision``, ``free_floor`` (where it
could go), ``bumper``, ``range_ring``, ``elevator``, ``building`` (what the body needs of a world), ``body_camera`` (one
picture at a time), ``faulty_body`` (the robot as its devices let it be reached).
"""
