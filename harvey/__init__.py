"""The only wiring place, and the command line.

One thread for linear algebra: faster for matrices as small as ours, and the order of additions never varies. It must be
said before numpy is first imported.
"""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
