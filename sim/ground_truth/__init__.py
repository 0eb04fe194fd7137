"""Where the building and the camera differ from what the robot believes: the ``[truth]`` of a scenario.

In reading order: ``table`` (the file's tables), ``inexact`` (a building by centimetres otherwise than its model),
``things`` (solid things by name, and things that were moved), ``true_changes`` (a door's leaf; faces that are there
or gone, from one time to another; what is seen and what is solid at each time).
"""
