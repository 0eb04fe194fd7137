"""Belief: how evidence is added up, of places, doors and milestones alike.

``odds`` adds the log odds of looks, and counts once what two looks show both; ``places`` weighs a place against its
rivals, by what was believed before and by the picture.
"""
