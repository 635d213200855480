"""Seeds made from the networks: worlds and transitions that nobody can have looked at while these were trained."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

from toolkit.errors import InputError
from toolkit.prediction.networks import digest

_RANGE = 2**30  # leaves room for the seeds that are counted up from the first one


def fresh_seed(networks: Path, purpose: str) -> int:
    """The first seed of an experiment.

    Args:
        networks: Folder of the networks, whose weights decide the seed.
        purpose: Name of the experiment; each has seeds of its own.

    Returns:
        A whole number from 0 to 2^30.

    Raises:
        InputError: The folder holds no networks.
    """
    if not any(networks.glob("*.safetensors")):
        raise InputError(f"{networks}: holds no networks to make a seed from; give --seed-offset")
    mixed = hashlib.sha256(f"{purpose} {digest(networks)}".encode()).digest()
    return int.from_bytes(mixed[:8], "big") % _RANGE


def add_seed_option(parser: argparse.ArgumentParser) -> None:
    """Add `--seed-offset`, in place of the one that counts from 0."""
    parser.add_argument(
        "--seed-offset",
        "--seed",
        type=int,
        metavar="N",
        help="first seed (default: made from the hash of the robot's networks, so that they have seen none of the "
        "worlds)",
    )
