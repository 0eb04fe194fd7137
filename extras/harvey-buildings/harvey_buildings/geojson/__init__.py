"""GeoJSON as a building plan: what ``harvey world export`` writes, and IMDF's units, openings and levels.

* :mod:`.features`: a file's features, checked.
* :mod:`.read_geojson`: rooms, doorways, things and links from them.
"""
