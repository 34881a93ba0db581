"""How the kernels are compiled."""

from numba import njit

ERROR_MODEL = 'numpy'  # a division by 0 gives inf instead of a check at every division

kernel = njit(error_model=ERROR_MODEL)
