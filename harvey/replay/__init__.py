"""What is done with a recorded run: what it would have done otherwise, and its recording drawn anew.

In reading order: ``counterfactual`` (a changed agent on the same observations), ``as_recorded`` (what makes its
decisions comparable with those of the record), ``counterfactual_words`` (its answer in sentences), ``repair``. The
replay itself is :mod:`harvey.runner.replay`.
"""
