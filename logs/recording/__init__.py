"""The rerun recording of a run.

In reading order: ``logger`` (one cycle as it is drawn; what draws one thing, and where it shows),
``loggers`` (all of them), ``writer`` (finds them and draws each decision), ``palette``, ``paths``, ``stream`` (rows to
columns to the disk).
"""
