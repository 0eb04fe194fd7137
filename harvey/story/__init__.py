"""Story: what happened in a run, told from its journal in a page of text. Why it did so, ``harvey/why`` tells.

In reading order: ``parts`` (a sentence with its cycle and entries), ``head`` (which run it is), ``turns`` (its turning
points), ``errand`` (what it was to do, and how it planned), ``lost`` (lost and found), ``met`` (contacts, doors,
things, the camera), ``milestones``, ``end``, ``story`` (all of it, and its first lines); ``truth`` (belief against
truth), ``questions`` (about the whole run).
"""
