"""The files of a run beside ``run.json``, and the recording that people look at.

In reading order: ``disk``, ``journal_file``, ``camera_file`` (what is on the disk before anyone acts on it),
``turning_points`` (what a short account of a run must tell), ``recording`` (the rerun recording; the only importer of
rerun, with ``reader``, which reads it back), ``errors``.
"""
