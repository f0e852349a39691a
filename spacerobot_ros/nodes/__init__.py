"""Thin ROS 2 nodes."""

import os

# The matrices here are small: a second BLAS thread costs more than it gives, and takes the core
# from the other nodes. Read by OpenBLAS when numpy is imported.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
