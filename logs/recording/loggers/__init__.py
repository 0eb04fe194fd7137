"""The loggers of a recording, one a file: each turns what changed in a cycle into what a person sees of it.

In reading order: ``frames`` (the shortest), ``errors``, ``decisions``, ``chapters``, ``lanes``, ``plan``,
``sketch_tree``, ``robots``, ``image``, ``floor_in_picture``, ``why``, ``description``; in ``surroundings`` what is
round the robot.

To add one: a file in this folder, or in one below it, with a class as :class:`logs.recording.logger.Logger` says, and
``LOGGERS = (TheClass,)`` at its end. In another package: the same class, and an entry point of the group
``harvey.loggers`` that names it.
"""
