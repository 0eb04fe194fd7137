"""The only wiring place, and the command line.

One thread for linear algebra and for pictures: faster for matrices as small as ours and where every core has a mission
of its own, and the order of additions never varies. It must be said before numpy and cv2 are first imported.
"""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
    os.environ.setdefault(_name, "1")
