"""Many missions.

In reading order: ``campaign`` (one mission as a task, and several), ``worker_pool`` (over several processes),
``tally`` and ``progress`` (what is shown meanwhile), ``summary`` (what is printed at the end).
"""
