"""A robot that is driven over ROS 2: its file, its odometry, its camera, its laser."""
