"""ROS 2 without ROS: a robot's base and camera, what others see of a run, bags.

In reading order: ``messages`` (types and bytes), ``middleware`` (publish, subscribe, close), ``zenoh_middleware`` and
``dds_middleware`` (over what they go).
"""
