"""Many missions, or cases of any kind.

In reading order: ``campaign`` (a mission as a task, and several of them), ``engine`` (work on cases, with results kept
as they come), ``workers`` (who works), ``case_work`` (what a worker does with one, and processes of this machine; the
extra harvey-cluster has those of a cluster), ``progress`` (what is shown meanwhile), ``summary`` (what is printed at
the end), ``show`` (what a campaign's files tell).
"""
