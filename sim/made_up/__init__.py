"""Made-up rooms, floors and missions for tests and experiments.

``box_room`` (a furnished room without a world file), ``chessboard`` (a calibration target before a camera),
``short_missions`` (scenario texts of seconds), ``generated_floors`` with ``generated_floors_text`` (random office
floors as world files).
"""
