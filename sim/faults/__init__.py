"""What goes wrong in a mission: one frozen dataclass a kind of fault. Its fields are its keys in ``[[faults]]``.

In reading order: ``fault`` (what every fault is, what it may do to the body, and which faults are due),
``built_in_faults`` (those that come with the simulator; ``LightsOff`` is the shortest one), ``fault_registry`` (from
a ``kind`` in a file to its class).

To add a fault here: a class in ``built_in_faults``, and its name in ``fault_registry.BUILT_IN``. To add one in
another package: a file with the same, and an entry point of the group ``harvey.faults`` whose name is the fault's
``kind``.
"""
