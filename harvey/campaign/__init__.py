"""Many missions, or cases of any kind.

In reading order: ``campaign`` (one mission as a task), ``missions`` (several of them), ``engine`` (work on cases, with
results kept as they come), ``workers`` (who works), ``case_work`` (what a worker does with one), ``local_workers``
(processes of this machine; the extra harvey-cluster has those of a cluster), ``results_file``, ``origin``
(whose results they are), ``tally`` and ``progress`` (what is shown meanwhile), ``summary`` (what is printed at the
end), ``show`` and ``compare`` (what a campaign's files tell).
"""
