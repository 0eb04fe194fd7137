"""The loggers of a recording: each turns what changed in a cycle into what a person sees of it.

In reading order: ``error_plots`` (the shortest), ``decisions``, ``lanes``, ``why_panel``, ``plan``, ``robots``,
``picture_overlays``; in ``surroundings`` what is round the robot.

To add one: a class as :class:`logs.recording.logger.Logger` says, in a file in this folder, or in one below it, with
``LOGGERS = (TheClass,)`` at its end. In another package: the same class, and an entry point of the group
``harvey.loggers`` that names it.
"""
