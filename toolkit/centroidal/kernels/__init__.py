"""Compiled (numba) parts of the fast centroidal solver. Everything here is in its scaled units, see `setup`."""
