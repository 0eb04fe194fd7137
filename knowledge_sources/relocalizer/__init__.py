"""Relocalization (§3.3): lost, and found again; and whether another place looks the same.

Read ``probe_photographer`` and ``panorama_builder`` (a look round), ``localizer`` (the places that explain it),
``prober`` (where to look next), ``pose_adopter`` (one place is believed), ``alias_monitor`` (how likely is the other).
"""
