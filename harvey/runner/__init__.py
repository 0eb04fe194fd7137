"""A run: an agent at work through a body. No simulator and no hardware is imported here.

In reading order: ``ports`` (the body, and how requests on the board reach it), ``run`` (from the command to the
outcome), ``result`` (``result.json``), ``replay`` (decide a run again from its observations), ``resume`` (go on after a
crash).
"""
