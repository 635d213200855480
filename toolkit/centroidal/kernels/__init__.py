"""Compiled (numba) parts of the fast centroidal solver. Everything here is in its scaled units, see `setup`."""

import hashlib
from pathlib import Path

from numba import njit

compiled = njit(fastmath={"reassoc", "contract", "arcp", "nsz"}, error_model="numpy", nogil=True)
"""Decorator of every kernel. Sums may be reordered; nan and inf keep their meaning."""


def sources(*others: str) -> int:
    """A hash of all sources in this folder, and of other files.

    numba's disk cache watches the file of the compiled function only. What a compiled function's closure holds is part
    of the cache's key as well: with this number in it, what the function calls is watched too.
    """
    digest = hashlib.sha256()
    for path in [*sorted(Path(__file__).parent.glob("*.py")), *map(Path, others)]:
        digest.update(path.read_bytes())
    return int.from_bytes(digest.digest()[:6], "little")
