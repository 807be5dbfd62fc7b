"""Command line: one module for each group of commands."""

import os

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
    os.environ.setdefault(_variable, "1")  # the same results on any number of cores, which missions share
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "64000000")  # a small file may decompress to more than the memory
