"""Model (§4, "models are incomplete"): what differs from the building that the robot knows.

Read ``floor_watcher`` and ``range_watcher`` (where floor is free), ``thing_mapper``, ``touch_finder``,
``halt_explainer`` and ``thing_mover`` (things), ``rival_weigher`` (what explains a difference),
``door_watcher``, ``door_toucher`` and ``shut_door_explainer`` (doors), ``model_reviser`` (it is entered into the
locale) and ``dependency_withdrawer`` (what rested on the old model goes).
"""
