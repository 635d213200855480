"""Local search on the true cost: contacts are left out, steps merged, neighbours swapped and landing points moved.

A search judges transitions one by one, from what it predicts. Here each variant of a finished sequence is screened by
the search's own rules, its whole motion is optimised, and its true cost decides.
"""

from toolkit.refine.local_search import LocalSearch, RefineConfig

__all__ = ["LocalSearch", "RefineConfig"]
