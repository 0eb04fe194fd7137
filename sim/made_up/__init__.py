"""Made-up rooms, floors and missions for tests and experiments.

``box_room`` (a furnished room without a world file), ``chessboard`` (a calibration target before a camera),
``short_missions`` (scenario texts of seconds). As world files: ``generated_house`` (a few rooms), ``generated_floors``
with ``floor_plan`` and ``generated_floors_text`` (furnished office floors). As scenarios: ``cluttered_missions`` with
``clutter`` (things in the way that the model lacks).
"""
