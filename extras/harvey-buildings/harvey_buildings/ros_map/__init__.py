"""How does a ROS map become a building plan? In reading order:

* :mod:`.map_yaml`: the map.yaml.
* :mod:`.occupancy`: the picture's cells: free, occupied, unknown.
* :mod:`.grid`: the cells turned so that most walls run along rows and columns, and the way back to the map's frame.
* :mod:`.gaps`: doorways and wide openings, as gaps of walls.
* :mod:`.rooms`: the floor parted into rooms at the gaps.
* :mod:`.outlines`: the rooms' straight walls.
* :mod:`.read_ros_map`: the building plan.
"""
