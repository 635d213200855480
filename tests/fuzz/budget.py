"""How long the fuzzers run, and with which seed.

    FUZZ_SECONDS=3600 FUZZ_SEED=7 python -m pytest tests/fuzz -m slow -s

FUZZ_SECONDS is the time of all fuzzers together, by default a quarter of an hour. Each takes its own part of it, also
where it is run alone; what has to be compiled or imported first comes on top. A failure names its case and the seed,
which is all that it takes to see it again.
"""

import os

SECONDS = float(os.environ.get("FUZZ_SECONDS", 900))
SEED = int(os.environ.get("FUZZ_SEED", 0))
PARTS = {"verdicts": 0.4, "commands": 0.25, "worlds": 0.12, "robots": 0.12, "runs": 0.06, "plans": 0.05}
"""Part of the time that each fuzzer takes."""


def seconds(fuzzer: str) -> float:
    """Time of a fuzzer in s."""
    return SECONDS * PARTS[fuzzer]
