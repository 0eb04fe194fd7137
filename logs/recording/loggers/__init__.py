"""The loggers of a recording, one a file: each turns what changed in a cycle into what a person sees of it.

In reading order: ``frames`` (the shortest), ``errors``, ``decisions``, ``chapters``, ``lanes``, ``plan``,
<<<<<<< HEAD
``sketch_tree``, ``robots``, ``building``, ``true_building``, ``image``, ``why``, ``description``.
=======
``sketch_tree``, ``robots``, ``building``, ``locale_frames``, ``image``, ``why``, ``description``.
>>>>>>> hub/main

To add one: a file in this folder with a class as :class:`logs.recording.logger.Logger` says, and
``LOGGER = TheClass`` at its end. In another package: the same class, and an entry point of the group
``harvey.loggers`` that names it.
"""
