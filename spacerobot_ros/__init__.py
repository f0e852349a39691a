"""Onboard estimation and control of a free-floating space robot with spinning wheels on board."""

import os

# The matrices here are small: a second BLAS thread costs more than it gives, and takes the core
# from the other nodes. Read by OpenBLAS when numpy is imported.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

__version__ = '0.2.0'
