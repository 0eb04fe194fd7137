"""Milestones to come (§3.3, §4): what should be seen on the way, from where, and whether it is time to look.

Read ``view_chooser`` (which landmarks tell most, from which heading), ``view_predictor`` (their lines in the picture),
``view_updater`` (what has come into the way since) and ``belief_checker`` (a look between milestones, when in doubt).
"""
