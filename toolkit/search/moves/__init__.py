"""Moves of one limb out of a stance, and the screens that they have to pass."""
