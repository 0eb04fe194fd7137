"""Serve: a page in the browser while a simulated mission runs.

In reading order: ``gate`` (pause, stop and pace, before each request to the body), ``live_state`` (decisions in, what
the page shows out), ``app`` (who may ask for what), ``server`` (a thread that serves it). ``live.html`` and ``live.js``
are the page; it borrows look and drawing from ``harvey/report``.
"""
