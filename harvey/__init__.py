"""Harvey: model-directed mobile robot navigation on a blackboard.

Importing it sets environment variables that are not set yet, because the libraries read them when they are first
imported: OPENBLAS_NUM_THREADS, OMP_NUM_THREADS, MKL_NUM_THREADS and OPENCV_FOR_THREADS_NUM to 1 and, on a processor
with AVX2, those that keep numpy, OpenBLAS and OpenCV from using more (:mod:`harvey.arithmetic` says which and why). So
the same run is decided the same on every such machine. A variable that is set already stays as it is.
"""

from harvey.arithmetic import settle
from harvey.packages import check_packages

settle()
check_packages()
