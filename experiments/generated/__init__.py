"""Generated rooms, floors, missions and clutter, the same for the same seed; tests use them too.

``scenes`` (a furnished room, a calibration board, small houses), ``floors``
with ``floor_plan`` (furnished office floors as world files, and their maps), ``light`` (lamps and sun, errands). As
scenarios: ``missions`` (short ones too), ``door_missions``, and ``clutter`` (things in the way that the model lacks).
"""
