"""What goes wrong in a mission: one frozen dataclass a kind of fault. Its fields are its keys in ``[[faults]]``.

In reading order: ``fault`` (what every fault is, and what it may do to the body), ``lights_off`` (the shortest one),
``occlusion``, ``displacement`` (bump and kidnap), ``base_faults`` and ``camera_faults`` (a device does not work for a
while), ``schedule`` (which faults are due), ``registry`` (from a ``kind`` in a file to its class).

To add a fault here: one file with its class, and its name in ``registry.BUILT_IN``. To add one in another package: the
same file there, and an entry point of the group ``harvey.faults`` whose name is the fault's ``kind``.
"""
