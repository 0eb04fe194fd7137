"""The hello world of the blackboard's README as a behaviour tree. It asks again each tick, and keeps no reasons."""

import py_trees


class Greeter(py_trees.behaviour.Behaviour):
    """Writes a greeting once something is heard."""

    def __init__(self):
        super().__init__("greeter")
        self.board = self.attach_blackboard_client(name="greeter")
        self.board.register_key(key="heard", access=py_trees.common.Access.READ)
        self.board.register_key(key="greeting", access=py_trees.common.Access.WRITE)

    def update(self):
        if not self.board.exists("heard"):
            return py_trees.common.Status.RUNNING
        self.board.greeting = f"hello, {self.board.heard}"
        return py_trees.common.Status.SUCCESS


ear = py_trees.blackboard.Client(name="ear")
ear.register_key(key="heard", access=py_trees.common.Access.WRITE)
ear.register_key(key="greeting", access=py_trees.common.Access.READ)
tree = py_trees.trees.BehaviourTree(Greeter())
tree.tick()
ear.heard = "world"
tree.tick()
print(ear.greeting)
