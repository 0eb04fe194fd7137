"""The files of other programs: GeoJSON, IFC, IndoorGML, ROS maps."""
