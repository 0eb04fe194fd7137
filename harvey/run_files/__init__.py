"""The files of a run: what they hold, how they are written and read back.

In reading order: ``run_directory`` (which files there are), ``run_head`` (``run.json``: how it began),
``deciding_code`` (by which program), ``run_recorder`` (writes while the run goes on), ``records`` (the journal read
back), ``decoding`` and ``observations`` (its values as they were).
"""
