"""Is a door of the model open or shut? What a picture shows in its opening (§4: models are incomplete).

In reading order:

* :mod:`opening`: the part of a picture that looks through a doorway, and what the model has beyond.
* :mod:`leaf`: is that seen, or a leaf? Evidence as a log likelihood ratio.
* :mod:`belief`: from the pictures of a door to its state.
* :mod:`explanation`: does a shut door explain a picture that is not as expected?
"""
