"""Report of several missions: a campaign, or runs beside each other, as one HTML file.

In reading order: ``missions`` (what is known of each), ``fields`` (which of it is a column, and in which unit),
``distributions`` (its plots), ``page`` (all of it in one file; ``page.html`` and ``page.js`` beside it are its frame).
"""
