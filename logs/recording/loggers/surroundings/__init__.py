"""What is round the robot: as its model has it, as it is seen, ranged and touched, and as it truly is.

In reading order: ``model_building``, ``locale_frames``, ``found``.
"""
