"""Senses (§3.2): what the robot learns of its own camera and wheels, and whether one of them lies.

Read ``camera_calibrator`` (focal length and mounting, by matched lines), ``yaw_calibrator`` (where it looks aside) and
``travel_breaker`` (what breaks the way that this is learnt from). A monitor posts what is not as expected, once and
unexplained; the rivals that would explain it compete: ``lens_monitor`` (the camera bends lines otherwise than is
stated), ``correction_monitor`` (pictures and wheels do not agree), ``push_monitor`` (a step), ``exposure_monitor``
(darkness), ``bumper_monitor`` (it feels what cannot be there); ``wheels_calibrator`` learns how far the wheels go, and
``sense_judge`` says what follows.
"""
