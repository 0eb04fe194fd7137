"""The rerun recording of a run.

In reading order: ``logger`` (what draws one thing, and where it shows), ``loggers`` (all of them), ``writer`` (finds
them and draws each decision), ``board_mirror`` and ``messages`` (what they ask), ``palette``, ``paths``, ``stream``
(rows to columns to the disk), ``blueprint``, ``overview`` (several runs).
"""
