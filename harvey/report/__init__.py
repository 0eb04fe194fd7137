"""Report: a run, or several, as one HTML file that opens without network or install.

In reading order: ``data`` (what the page scrubs through: cycles, entries, poses, pictures, and the plan with both
paths), ``drawing`` (its plots), ``page`` (all of it in one file; ``page.html``, ``page.css`` and ``page.js`` next to it
are its frame), ``several`` (a campaign, or runs side by side). Its text is ``logs/explain/story.py``.
"""
