"""The knowledge sources round the blackboard, one a file by servo level: when and why; ``methods``: how."""
