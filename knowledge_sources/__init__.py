"""The experts round the blackboard: one a file, saying when and why; ``methods`` says how."""
