"""Where the building and the camera differ from what the robot believes: the ``[truth]`` of a scenario.

In reading order: ``table`` (the file's tables), ``inexact`` (a building by centimetres otherwise than its model),
``shapes`` (solid things by name), ``leaf`` (a door's leaf, shut or ajar), ``change`` (faces that are there, or gone,
from one time to another), ``changing_faces`` (what is seen and what is solid at each time).
"""
