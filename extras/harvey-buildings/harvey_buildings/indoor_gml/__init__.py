"""What does an IndoorGML file (OGC 14-005, and 2.0's core) say of a building?

In reading order:

* :mod:`.xml_reader`: XML from anywhere, without entities, with limits.
* :mod:`.gml`: GML elements: ids, texts, references, points.
* :mod:`.cells`: the floor of each cell, and the boundaries that a way passes.
* :mod:`.navigation_graph`: the layers of the file, and the graph to plan on.
* :mod:`.read_indoor_gml`: rooms, doors and links, into a building plan.
"""
