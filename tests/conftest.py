"""Property tests try the same examples every time, so that what holds on one machine holds on the next.

``pytest --hypothesis-profile=search`` looks further: other examples at every run. What it finds is mended, and kept as
an ``@example`` beside its law.
"""

from hypothesis import settings

settings.register_profile("same", derandomize=True)
settings.register_profile("search", derandomize=False, print_blob=True)
settings.load_profile("same")
