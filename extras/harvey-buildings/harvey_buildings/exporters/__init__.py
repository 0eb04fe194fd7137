"""How do other programs read a world? A ROS map, a plan as SVG, GeoJSON and glTF.

* :mod:`.ros_map`: a storey as the grid of a map server.
* :mod:`.geojson`: rooms, doorways and things as features, in metres.
* :mod:`.gltf`: surfaces with their colours, for Blender and viewers in browsers.
* :mod:`.export_file`: the format from a file's ending, and its file.

The plan is drawn by :mod:`world_models.building.plan_view`.
"""
