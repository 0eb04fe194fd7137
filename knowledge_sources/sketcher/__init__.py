"""Sketcher (§3.2, §4): what to do next. From a goal to a plan sketch, refined depth-first until a leg can be driven.

Read ``goal_sketcher`` (a goal becomes a sketch), ``refiner`` (a subgoal becomes a finer sketch or a leg),
``sketch_advancer`` and ``milestone_passer`` (what is done is passed), ``detour_finder`` and ``lookout_planner`` (a way
round what stands there, and where to look from first).
"""
