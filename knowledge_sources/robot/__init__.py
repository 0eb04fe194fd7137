"""Robot (§3.2): what the robot learns of its own camera and wheels.

Read ``camera_calibrator`` (focal length and mounting, by matched lines), ``yaw_calibrator`` (where it looks aside) and
``travel_breaker`` (what breaks the way that this is learnt from).
"""
