"""How functions are compiled: what Python calls is `compiled` (or `summed`), the rest `inner`."""

from __future__ import annotations

import numba

compiled = numba.njit(cache=True, nogil=True, error_model='numpy')  # singular gives NaN, no error
inner = numba.njit(nogil=True, error_model='numpy', no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""For what compiled functions alone call: a quarter less to compile."""
summed = numba.njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
"""For long sums, whose order is free, so that they run on vector units."""
Triple = tuple[float, float, float]
"""Three numbers in compiled code, so that nothing is allocated."""
