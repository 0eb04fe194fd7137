"""Somebody else drives: Harvey says where the robot is, or that it is lost."""
