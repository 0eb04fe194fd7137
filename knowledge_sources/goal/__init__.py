"""Goal (§3.1, §4): what is wanted, and how a mission ends.

Read ``interpreter`` (a command becomes a goal), ``goal_changer`` and ``goal_renewer`` (another goal, or the same from
another place), ``discrepancy_raiser`` (a difference climbs a servo level), ``goal_closer`` and ``mission_monitor``.
"""
