"""Is a door of the model open or shut? What a picture shows in its opening (§4: models are incomplete).

In reading order:

* :mod:`rival_views`: how well a leaf explains what is seen, what is beyond, and a leaf that is ajar;
* :mod:`leaf`: the part of a picture that looks through a doorway; is what the model has beyond seen there, or a leaf?
* :mod:`belief`: from the pictures of a door to its state; does a shut door explain a picture that is not as expected?
"""
