"""ROS 2 without ROS: a robot's base and camera, what others see of a run, bags.

In reading order: ``messages`` (types and bytes, and over what they go), ``robot`` (a robot that is driven),
``following`` (somebody else drives) and ``recordings`` (somebody else drove), ``company`` (what others see and say),
``emulated`` (a robot that is not there).
"""
