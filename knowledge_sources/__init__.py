"""The knowledge sources round the blackboard, one a file by subject: when and why.

``reads``: what they ask of the board. ``methods``: how it is computed.
"""
