"""Milestone (§6, §7): is what was predicted there, and what follows for the robot's place.

Read in the order in which a picture passes them: ``line_finder``, ``obstruction_finder``, ``matcher``, ``med_r_and_t``,
``milestone_judge`` (verified, refuted, or not testable), ``plan_adjuster`` (the belief takes the pose over).
"""
