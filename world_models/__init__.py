"""What the robot knows: itself, its building, and the kinds of entries of the blackboard. Data and pure functions.

``entries`` (what lies on the board), ``building`` (locales, faces, landmarks), ``visibility`` (what is in view),
``files`` (how a building is read), ``worlds`` (buildings that come with the project). Outside them: ``frames``,
``camera``, ``actuator`` and ``robot`` (the robot's model of itself), ``commands`` (goals), ``units`` (and bounds),
``plugins`` (what other packages add).
"""
