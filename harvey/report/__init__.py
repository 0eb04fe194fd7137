"""Report: a run, or several, as one HTML file that opens without network or install.

In reading order: ``data`` (what the page scrubs through: cycles, entries, poses), ``plan`` (the building with both
paths), ``pictures`` (of the camera, with lines), ``drawing`` and ``errors`` (the plot), ``page`` (all of it in one
file; ``page.html``, ``page.css`` and ``page.js`` beside it are its frame). Its text is ``harvey/story``.
``several/`` is the report of a campaign, or of runs beside each other.
"""
