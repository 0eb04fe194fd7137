"""ROS 2 without ROS: a robot's base and camera, what others see of a run, bags.

In reading order: ``messages`` (types and bytes), ``middleware`` (publish, subscribe, close), ``zenoh_middleware`` and
``dds_middleware`` (over what they go); ``robot_file`` (how a robot calls things), ``node``, ``odometry``,
``ros2_base``, ``ros2_camera`` (a robot that is driven), ``pipe``; ``run_messages``, ``mcap_export``, ``ros2_company``
(what others see and say); ``localizer_sources``, ``onlooker``, ``bag_reader``, ``follow_command``, ``live_robot``
(somebody else drives); ``robot_emulator``, ``robot_server`` (a robot that is not there).
"""
