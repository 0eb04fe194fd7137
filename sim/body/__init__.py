"""The simulated robot in its building.

In reading order: ``simulated_body`` (the robot: commands, pictures, time and faults), ``wheel_errors`` (errors of the
wheels, §3.2, and a motion that is steered on the move), ``collision`` (what it bumps into, and where it could go),
``senses`` (bumper and sonars), ``simulated_building`` (what it needs of a world, elevators), ``body_camera`` (a
picture at a time), ``faulty_body`` (the robot as its devices let it be reached).
"""
