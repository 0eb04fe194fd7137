"""Messages of ROS 2, and over what they go: Zenoh, Cyclone DDS or a pipe."""
