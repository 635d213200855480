"""Where the robots and worlds that come with the toolkit lie."""

from __future__ import annotations

from pathlib import Path

INSIDE = "_shipped"
"""Folder in an installed package that holds them; in a checkout they lie beside the package."""


def shipped(kind: str) -> Path:
    """The folder `robots` or `worlds` that comes with the toolkit, whatever the working directory is."""
    package = Path(__file__).resolve().parent
    inside = package / INSIDE / kind
    return inside if inside.is_dir() else package.parent / kind
