"""Many missions, or cases of any kind.

In reading order: ``mission_task`` (a mission, and several of them), ``engine`` (work on cases, with results kept as
they come), ``workers`` (who works on them, and how; the extra harvey-cluster has those of a cluster), ``summary`` (what
is said of missions meanwhile and at the end), ``show`` (what a campaign's files tell).
"""
