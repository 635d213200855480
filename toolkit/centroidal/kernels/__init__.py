"""Compiled (numba) parts of the fast centroidal solver. Everything here is in its scaled units, see `setup`."""

from numba import njit

compiled = njit(fastmath={"reassoc", "contract", "arcp", "nsz"}, error_model="numpy", nogil=True)
"""Decorator of every kernel. Sums may be reordered; nan and inf keep their meaning."""
