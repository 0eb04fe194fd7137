"""What a person sees of a run: its files, the run read back and explained, and the recording.

In reading order: ``run_directory`` (which files there are), ``run_head`` and ``decided_by`` (how it began, by which
program), ``disk``, ``journal_file``, ``mjpeg_file`` (what is on the disk before anyone acts on it), ``run_recorder``
(writes while the run goes on), ``mirror`` (the board meanwhile); ``records``, ``timeline`` (the journal read back,
typed, and asked by name), ``pictures``; ``explain`` (in sentences), ``export`` and ``tables``; ``recording`` (the rerun
recording; the only importer of rerun, with ``reader``, which reads it back), ``run_errors``.
"""
