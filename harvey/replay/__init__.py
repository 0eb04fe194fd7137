"""A recorded run asked again: what it would have done otherwise, and why something was not done.

Read first :mod:`harvey.replay.what_if`, what can be taken away or set, then :mod:`harvey.replay.counterfactual`, which
decides a run again so, and :mod:`harvey.replay.why_not_again`, why something was not done.
"""
