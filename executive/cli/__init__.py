"""The command line: the only package that puts executive, skills and plant together."""

import os

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")  # sums come out the same to the last bit, and two missions share two cores
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "64000000")  # a small file may unfold to more than the memory
