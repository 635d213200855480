"""Worlds: MJCF scenes, the surfaces they offer, and random terrain."""
