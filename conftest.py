"""Property tests try the same examples every time, so that what holds on one machine holds on the next.

``pytest --hypothesis-profile=search`` looks further: other examples at every run. What it finds is mended, and kept as
an ``@example`` beside its law. ``mutants`` does not look for the smallest example that fails.
None asks how long an example takes: the first one may compile what it calls.
"""

import signal

from hypothesis import Phase, settings

import harvey  # noqa: F401  # before numpy: it tells the libraries how to calculate

# A shell that starts the tests in the background has them ignore Ctrl-C, and so would what they start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("search", derandomize=False, print_blob=True, deadline=None)
settings.register_profile("mutants", derandomize=True, deadline=None, phases=(Phase.explicit, Phase.generate))
settings.load_profile("same")
