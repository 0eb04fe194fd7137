"""Report: a run as one HTML file that opens without network or install.

In reading order: ``data`` (what the page scrubs through: cycles, entries, poses), ``plan`` (the building with both
paths), ``pictures`` (of the camera, with lines), ``errors`` (the plot), ``page`` (all of it in one file; ``page.html``,
``page.css`` and ``page.js`` beside it are its frame). Its text is ``harvey/story``.
"""
