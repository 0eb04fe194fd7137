"""What does an IFC file (ISO 16739) say of a building? Read with ifcopenshell, an extra.

In reading order:

* :mod:`.read_ifc`: opens a file in a process of its own, with time limits.
* :mod:`.opened_file`: the opened file and the building plan that is read from it.
* :mod:`.relations`: names, containers and fillings of elements.
* :mod:`.shapes`: floors, wall holes and footprints from the shapes of elements.
* :mod:`.spaces`: storeys and spaces.
* :mod:`.passages`: doors, openings, places without a wall, and windows.
* :mod:`.boxes`, :mod:`.contents`: furniture, stairs and elevators.
* :mod:`.plan_reader`: all of these in order, and the report.
"""
