"""The rerun recording of a run.

In reading order: ``logger`` and ``panel`` (what draws one thing, and where it shows), ``loggers`` (all of them, one a
file), ``writer`` (finds them and draws each decision), ``board_mirror``, ``belief``, ``activity``, ``messages`` (what
they ask), ``palette``, ``signs``, ``paths``, ``stream`` (rows to columns to the disk), ``blueprint``,
``building_recording``, ``overview`` (several runs).
"""
