"""Names for the array shapes used in signatures; all arrays are float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Vector3 = Array  # (3,)
Vector6 = Array  # (6,) [linear; angular]
Matrix3 = Array  # (3, 3)
Quaternion = Array  # (4,) Hamilton, xyzw
